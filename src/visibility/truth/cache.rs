//! Sample truth kept on disk. A file is named by what was asked and ends with its
//! own digest: one that is of something else, cut short or altered is computed anew,
//! never trusted.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use glam::DVec3;
use hmac_sha256::Hash;

use super::ray_index::RayIndex;
use super::sample::{NO_ITEM, SampleTruth};
use crate::query::ItemId;
use crate::visibility::{Rays, SampleGrid, Solids};

/// First bytes of a file: what it is, and the version of form and semantics.
const MAGIC: &[u8; 16] = b"sample-truth 01\n";

/// Bytes of a SHA-256.
const DIGEST: usize = 32;

/// A directory that keeps sample truth.
#[derive(Clone, Debug)]
pub struct TruthCache {
    directory: PathBuf,
}

impl TruthCache {
    /// In this directory, which is made when something is first kept.
    pub fn new(directory: impl Into<PathBuf>) -> TruthCache {
        let directory = directory.into();
        TruthCache { directory }
    }

    /// [`SampleTruth::of`], from disk if it was asked before. `digest` is that of the
    /// boxes ([`digest_of`]). A file that cannot be read or written is no error: the
    /// truth is computed, and asked anew the next time.
    pub fn sample_truth(
        &self,
        digest: &[u8; 32],
        solids: &Solids,
        index: &RayIndex,
        rays: &Rays,
        grid: SampleGrid,
        threads: usize,
    ) -> SampleTruth {
        let key = key_of(digest, rays, grid);
        let path = self.path(&key);
        let kept = fs::read(&path).ok();
        if let Some(truth) = kept.and_then(|bytes| decoded(&bytes, &key, grid, index.len())) {
            return truth;
        }
        let truth = SampleTruth::of(solids, index, rays, grid, threads);
        // What cannot be kept is only slower.
        let _ = self.write(&path, &encoded(&truth, &key));
        truth
    }

    fn path(&self, key: &[u8; 32]) -> PathBuf {
        let name: String = key.iter().map(|byte| format!("{byte:02x}")).collect();
        self.directory.join(name).with_extension("truth")
    }

    /// Whole or not at all: written beside and renamed.
    fn write(&self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        fs::create_dir_all(&self.directory)?;
        let mut file = tempfile::NamedTempFile::new_in(&self.directory)?;
        file.write_all(bytes)?;
        file.persist(path)?;
        Ok(())
    }
}

/// The digest of the boxes as they were written, in their order. O(n).
pub fn digest_of(solids: &Solids) -> [u8; 32] {
    let mut hash = Hash::new();
    let corners = solids.boxes.iter().flat_map(|b| [b.min, b.max]);
    corners.for_each(|corner| update(&mut hash, corner));
    hash.finalize()
}

fn update(hash: &mut Hash, p: DVec3) {
    let numbers = p.to_array().into_iter();
    numbers.for_each(|x| hash.update(x.to_bits().to_le_bytes()));
}

/// The digest of a question: boxes, the numbers that all rays are made of, the grid.
fn key_of(digest: &[u8; 32], rays: &Rays, grid: SampleGrid) -> [u8; 32] {
    let mut hash = Hash::new();
    hash.update(MAGIC);
    hash.update(digest);
    let frame = &rays.camera().frame;
    let axes = [frame.eye, frame.u(), frame.v(), frame.forward()];
    axes.into_iter().for_each(|axis| update(&mut hash, axis));
    // Two rays tell an orthographic lens from one with a centre; near and far are
    // those of all.
    for ray in [rays.through(0.0, 0.0), rays.through(1.0, 1.0)] {
        update(&mut hash, ray.origin);
        update(&mut hash, ray.direction);
        update(&mut hash, DVec3::new(ray.near, ray.far, 0.0));
    }
    let window = rays.window().into_iter();
    window.for_each(|x| hash.update(x.to_bits().to_le_bytes()));
    hash.update(grid.width.to_le_bytes());
    hash.update(grid.height.to_le_bytes());
    hash.finalize()
}

/// Magic, key, number of visible items, front items, visible items, their samples,
/// and the digest of all that.
fn encoded(truth: &SampleTruth, key: &[u8; 32]) -> Vec<u8> {
    let mut bytes = [&MAGIC[..], key].concat();
    let count = truth.visible.len() as u32;
    let words = [
        &[count],
        &truth.front[..],
        &truth.visible,
        &truth.samples_of,
    ];
    for word in words.into_iter().flatten() {
        bytes.extend(word.to_le_bytes());
    }
    bytes.extend(Hash::hash(&bytes));
    bytes
}

/// `None` for bytes that are not the answer to this question.
fn decoded(bytes: &[u8], key: &[u8; 32], grid: SampleGrid, items: usize) -> Option<SampleTruth> {
    let (body, digest) = bytes.split_at_checked(bytes.len().checked_sub(DIGEST)?)?;
    let body = (Hash::hash(body) == digest).then_some(body)?;
    let body = body.strip_prefix(&MAGIC[..])?.strip_prefix(&key[..])?;
    let (words, rest) = body.as_chunks::<4>();
    let words: Vec<u32> = words.iter().map(|word| u32::from_le_bytes(*word)).collect();
    let (&count, words) = words.split_first()?;
    let (samples, count) = (grid.samples(), count as usize);
    let whole = samples.checked_add(count.checked_mul(2)?)?;
    (rest.is_empty() && words.len() == whole).then_some(())?;
    let (front, words) = words.split_at(samples);
    let (visible, samples_of) = words.split_at(count);
    let known = |&item: &ItemId| (item as usize) < items;
    let sound =
        front.iter().all(|item| *item == NO_ITEM || known(item)) && visible.iter().all(known);
    sound.then(|| SampleTruth {
        grid,
        front: front.to_vec(),
        visible: visible.to_vec(),
        samples_of: samples_of.to_vec(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Lens, look_at};
    use crate::scene::SeededRng;
    use crate::visibility::truth::judge;

    fn rays(far: Option<f64>) -> Rays {
        let frame = look_at(DVec3::splat(6.0), DVec3::ZERO, DVec3::Z).unwrap();
        let lens = Lens::perspective(60.0, 1.0, 0.5, far).unwrap();
        Rays::of(&Camera { frame, lens }).unwrap()
    }

    #[test]
    fn a_file_is_used_only_if_it_is_whole_and_of_this_question() {
        let directory = tempfile::tempdir().unwrap();
        let cache = TruthCache::new(directory.path().join("of").join("truth"));
        let boxes = judge::ties(&mut SeededRng::new(3), 12);
        let solids = judge::solids(&boxes);
        let index = RayIndex::build(&solids);
        let (digest, grid) = (digest_of(&solids), SampleGrid::new(9, 7));
        let ask = |rays: &Rays| cache.sample_truth(&digest, &solids, &index, rays, grid, 1);
        let truth = SampleTruth::of(&solids, &index, &rays(None), grid, 1);
        assert!(truth.visible.len() > 2, "the premise");
        assert_eq!(ask(&rays(None)), truth);
        let path = cache.path(&key_of(&digest, &rays(None), grid));
        let whole = fs::read(&path).unwrap();
        assert_eq!(whole, encoded(&truth, &key_of(&digest, &rays(None), grid)));

        // Read: of a lie with a sound digest nothing is noticed.
        let mut lie = truth.clone();
        lie.front[0] = 0;
        fs::write(&path, encoded(&lie, &key_of(&digest, &rays(None), grid))).unwrap();
        assert_eq!(ask(&rays(None)).front, lie.front);

        // Any byte altered, any end missing, anything behind it: computed and kept.
        let step = whole.len() / 60;
        let altered = (0..whole.len()).step_by(step).map(|at| {
            let mut bytes = whole.clone();
            bytes[at] ^= 4;
            bytes
        });
        let cut = (0..whole.len())
            .step_by(step)
            .map(|end| whole[..end].to_vec());
        for bytes in altered.chain(cut).chain([[&whole[..], b"\0"].concat()]) {
            fs::write(&path, &bytes).unwrap();
            assert_eq!(ask(&rays(None)), truth);
            assert_eq!(fs::read(&path).unwrap(), whole);
        }

        // The answer to another question under this name is not one.
        let other = cache.path(&key_of(&digest, &rays(Some(7.0)), grid));
        ask(&rays(Some(7.0)));
        fs::copy(&other, &path).unwrap();
        assert_eq!(ask(&rays(None)), truth);
        assert_eq!(
            fs::read_dir(path.parent().unwrap()).unwrap().count(),
            2,
            "nothing left over"
        );
    }

    #[test]
    fn every_number_of_a_question_is_part_of_it() {
        let of = |eye: DVec3, lens: Lens, grid: SampleGrid, digest: [u8; 32]| {
            let frame = look_at(eye, DVec3::ZERO, DVec3::Z).unwrap();
            key_of(&digest, &Rays::of(&Camera { frame, lens }).unwrap(), grid)
        };
        let (eye, grid) = (DVec3::splat(6.0), SampleGrid::new(8, 8));
        let lens = Lens::off_axis([-1.0, 1.0, -1.0, 1.0], 1.0, None).unwrap();
        let mut keys = vec![
            of(eye, lens, grid, [0; 32]),
            of(eye, lens, grid, [1; 32]),
            of(eye, lens, SampleGrid::new(16, 4), [0; 32]),
            of(eye.with_x(6.0f64.next_up()), lens, grid, [0; 32]),
            of(eye, lens.with_far(Some(9.0)).unwrap(), grid, [0; 32]),
            of(
                eye,
                Lens::off_axis([-1.0, 1.0, -1.0, 2.0], 1.0, None).unwrap(),
                grid,
                [0; 32],
            ),
            of(
                eye,
                Lens::off_axis([-2.0, 2.0, -2.0, 2.0], 2.0, None).unwrap(),
                grid,
                [0; 32],
            ),
            of(
                eye,
                Lens::orthographic(2.0, 1.0, 1.0, 9.0).unwrap(),
                grid,
                [0; 32],
            ),
        ];
        let count = keys.len();
        keys.sort_unstable();
        keys.dedup();
        assert_eq!(keys.len(), count);
    }

    #[test]
    fn a_directory_that_cannot_be_made_only_costs_time() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let cache = TruthCache::new(file.path());
        let solids = judge::solids(&judge::ties(&mut SeededRng::new(3), 5));
        let index = RayIndex::build(&solids);
        let (digest, grid) = (digest_of(&solids), SampleGrid::new(3, 3));
        let kept = cache.sample_truth(&digest, &solids, &index, &rays(None), grid, 1);
        assert_eq!(kept, SampleTruth::of(&solids, &index, &rays(None), grid, 1));
    }
}
