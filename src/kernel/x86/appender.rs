//! Appending to a list through its spare memory.
//!
//! A row is stored whole, whichever lanes count, and the list's length is set once.

use std::ops::Range;

use crate::kernel::isa::{Append, Isa, LANES, LaneMask};

/// Instructions that compress words into memory that may be uninitialised.
///
/// # Safety
/// [`CompressTo::compress_to`] writes the words of all lanes, and nothing behind the sixteenth place.
pub unsafe trait CompressTo: Isa {
    /// Moves the words of `lanes` together, lowest first, to `place`.
    ///
    /// # Safety
    /// `place` is valid for writes of [`LANES`] words.
    unsafe fn compress_to(self, place: *mut u32, words: Self::Words, lanes: LaneMask);
}

/// `Vec::reserve`, which is a call even where there is room.
#[inline(always)]
fn make_room(out: &mut Vec<u32>, words: usize) {
    if out.capacity() - out.len() < words {
        out.reserve(words);
    }
}

/// `out.extend_from_slice(words)`, calling only memcpy if there is room.
///
/// std makes two calls, and structures often pass a few ids.
#[inline(always)]
pub fn extend(out: &mut Vec<u32>, words: &[u32]) {
    make_room(out, words.len());
    let end = out.spare_capacity_mut().as_mut_ptr().cast();
    // SAFETY: there is room for `words.len()` words behind the end, and a list that is
    // borrowed mutably does not overlap `words`.
    unsafe {
        std::ptr::copy_nonoverlapping(words.as_ptr(), end, words.len());
        out.set_len(out.len() + words.len());
    }
}

/// Most words that are copied row by row.
const FEW: usize = 16 * LANES;

/// `extend(out, &words[places])`, row by row for few words.
///
/// A call of memcpy would cost more. The rest of the last row is read too.
#[inline(always)]
pub fn extend_from_range(out: &mut Vec<u32>, words: &[u32], places: Range<usize>) {
    let few = &words[places.clone()];
    let rows = few.len().div_ceil(LANES);
    if few.len() > FEW || words.len() - places.start < rows * LANES {
        return extend(out, few);
    }
    make_room(out, rows * LANES);
    let end = out.spare_capacity_mut().as_mut_ptr().cast::<u32>();
    // SAFETY: `rows` rows can be read from the first place on and written behind the
    // end, and a list that is borrowed mutably does not overlap `words`.
    unsafe {
        for row in 0..rows {
            let from = words
                .as_ptr()
                .add(places.start + row * LANES)
                .cast::<[u32; LANES]>();
            let to = end.add(row * LANES).cast::<[u32; LANES]>();
            to.write_unaligned(from.read_unaligned());
        }
        out.set_len(out.len() + few.len());
    }
}

/// The memory behind a list.
pub struct Appender<'a> {
    out: &'a mut Vec<u32>,
    /// Address of the next word; `room` words fit from there.
    end: *mut u32,
    room: usize,
    added: usize,
}

impl<'a, I: CompressTo> Append<'a, I> for Appender<'a> {
    #[inline(always)]
    fn onto(out: &'a mut Vec<u32>, words: usize) -> Self {
        let room = words + LANES;
        make_room(out, room);
        Appender {
            end: out.spare_capacity_mut().as_mut_ptr().cast(),
            room,
            added: 0,
            out,
        }
    }

    #[inline(always)]
    fn push(&mut self, isa: I, row: &[u32; LANES], lanes: LaneMask) {
        assert!(self.room >= LANES, "more words than there is room for");
        let count = lanes.count_ones() as usize;
        // SAFETY: a row fits, and `count` is at most a row.
        self.end = unsafe {
            isa.compress_to(self.end, isa.words(row), lanes);
            self.end.add(count)
        };
        self.room -= count;
        self.added += count;
    }
}

impl Drop for Appender<'_> {
    #[inline(always)]
    fn drop(&mut self) {
        // SAFETY: `added` words have been written behind the old end, within the
        // reserved room.
        unsafe { self.out.set_len(self.out.len() + self.added) };
    }
}
