//! Tables in the source, and the macros that declare them.
//!
//! Enums whose values have names for users and files, rows of structs, and fields with default
//! values.

/// Declares an enum with its names: `ALL` in this order, and `name`.
///
/// With a table name after the enum's, each name is followed by its description, which becomes its
/// doc comment, and the table has all three as rows.
macro_rules! named {
    ($(#[$about:meta])* $vis:vis enum $Enum:ident {
        $($(#[$of:meta])* $value:ident = $name:literal,)+
    }) => {
        $(#[$about])*
        $vis enum $Enum {
            $($(#[$of])* $value,)+
        }

        #[allow(dead_code, reason = "not every table is listed and shown")]
        impl $Enum {
            /// Every value, in the order of the declaration.
            $vis const ALL: [$Enum; [$($name),+].len()] = [$($Enum::$value),+];

            /// Name as it is typed, shown and written.
            $vis const fn name(self) -> &'static str {
                match self {
                    $($Enum::$value => $name,)+
                }
            }
        }
    };
    ($(#[$about:meta])* $vis:vis enum $Enum:ident, $TABLE:ident {
        $($(#[$of:meta])* $value:ident = $name:literal, $what:literal;)+
    }) => {
        named! {
            $(#[$about])*
            $vis enum $Enum {
                $(#[doc = $what] $(#[$of])* $value = $name,)+
            }
        }

        /// Every value with its name and description.
        $vis const $TABLE: [($Enum, &str, &str); $Enum::ALL.len()] =
            [$(($Enum::$value, $name, $what)),+];
    };
}

/// Declares a struct with its fields next to their default values.
macro_rules! defaults {
    ($(#[$about:meta])* $vis:vis struct $Struct:ident {
        $($(#[$of:meta])* pub $field:ident: $Type:ty = $value:expr,)+
    }) => {
        $(#[$about])*
        $vis struct $Struct {
            $($(#[$of])* pub $field: $Type,)+
        }

        impl Default for $Struct {
            fn default() -> Self {
                $Struct { $($field: $value,)+ }
            }
        }
    };
}

/// A table of structs, with the names of the fields written once.
macro_rules! rows {
    (@row $Row:ident { $($field:ident),+ } $($value:expr),+) => {
        $Row { $($field: $value),+ }
    };
    ($Row:ident $fields:tt $($($value:expr),+;)+) => {
        &[$(rows!(@row $Row $fields $($value),+)),+]
    };
}
