//! Notes: what a reader ignores or guesses, told once by the program, if it listens.

use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};

type Told = (fn(&str), BTreeSet<String>);

static LISTENER: Mutex<Option<Told>> = Mutex::new(None);

/// From now on `tell` gets each different note once. Without it nothing is told.
pub fn tell_notes(tell: fn(&str)) {
    let mut listener = LISTENER.lock().unwrap_or_else(PoisonError::into_inner);
    *listener = Some((tell, BTreeSet::new()));
}

/// One line about an input that is no error.
pub(crate) fn note(text: &str) {
    let mut listener = LISTENER.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((tell, told)) = listener.as_mut()
        && told.insert(text.to_owned())
    {
        tell(text);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::{read_cameras_csv, read_points_csv};
    use crate::scene::read_boxes_csv;

    static HEARD: Mutex<Vec<String>> = Mutex::new(Vec::new());

    #[test]
    fn columns_that_are_not_read_are_told_once() {
        tell_notes(|note| HEARD.lock().unwrap().push(note.to_owned()));
        let cameras = "eye_x,eye_y,eye_z,look_x,look_y,look_z,time_s,fov,Far,zfar,ortho_size,roll,,name,size\n\
                       0,0,0,1,0,0,0,90,9,9,9,0,,a,1\n";
        let points = "x,y,z,X\n1,2,3,4\n";
        let boxes = "min_x,min_y,min_z,max_x,max_y,max_z,Min_X,max_speed\n0,0,0,1,1,1,2,3\n";
        for _ in 0..2 {
            read_cameras_csv(cameras.as_bytes(), "note-c.csv", &Default::default()).unwrap();
            read_points_csv(points.as_bytes(), "note-p.csv").unwrap();
            read_boxes_csv(boxes.as_bytes(), "note-b.csv", false).unwrap();
        }
        let heard = HEARD.lock().unwrap();
        let heard: Vec<&String> = heard.iter().filter(|n| n.starts_with("note-")).collect();
        assert_eq!(
            heard,
            [
                "note-c.csv, line 1: columns that are not read: 'fov' (did you mean 'fovy_deg'?), \
                 'Far' (did you mean 'far'?), 'zfar' (did you mean 'far'?), 'ortho_size' (did you \
                 mean 'ortho_height'?), 'roll' (did you mean 'up_x,up_y,up_z'?), 'size'",
                "note-p.csv, line 1: columns that are not read: 'X' (did you mean 'x'?)",
                "note-b.csv: column 'Min_X' is kept as a label beside 'min_x'",
            ]
        );
    }
}
