//! Generated meshes: scenes of triangles.
//!
//! Each is made from a number of triangles and a seed, in its own file; the table `MESHES` in
//! `generate` names them all.

pub mod ground;
pub mod spheres;

#[cfg(test)]
mod tests {
    use super::super::{Family, MESHES, SurfaceKind, hex, load};
    use super::*;
    use glam::Vec3;

    #[test]
    fn every_mesh_has_about_the_triangles_asked_for_and_a_box_an_item() {
        for mesh in MESHES {
            assert_eq!(Family::named(mesh.name).unwrap().name, mesh.name);
            for asked in [1, 20_000] {
                let surfaces = mesh.mesh(asked, 7);
                let made = surfaces.triangles.len();
                assert!(made > 0 && made < asked + 2000, "{}: {made}", mesh.name);
                assert!(asked == 1 || made > asked / 2, "{}: {made}", mesh.name);
                assert!(surfaces.points.iter().all(|p| p.is_finite()));
                let next = surfaces.of_item.windows(2);
                assert!(next.into_iter().all(|w| w[0].end == w[1].start));
                let items = surfaces.items();
                let scene = surfaces.into_scene(mesh.name).unwrap();
                assert_eq!(scene.items.len(), items);
            }
        }
        assert!(Family::named("mesh:teapot").is_none() && Family::named("statue").is_none());
    }

    #[test]
    fn a_text_names_a_mesh_its_size_and_its_place() {
        let load = |text: &str| load(text, &Default::default());
        let near = load("mesh:spheres:n=3k,seed=2").unwrap();
        let far = load("mesh:spheres:n=3k,seed=2,offset=1e7").unwrap();
        let [a, b] = [&near, &far].map(|scene| scene.surfaces.as_ref().unwrap());
        assert_eq!((near.items.len(), &a.points), (2, &b.points));
        assert_eq!(
            (far.origin, b.origin),
            (glam::DVec3::splat(1e7), far.origin)
        );
        assert_eq!(far.items, near.items);
        for wrong in [
            "mesh:sphere",
            "mesh:",
            "mesh",
            "spheres",
            "mesh:spheres:n=0",
            "mesh:spheres:m=3",
            "mesh:spheres:offset=1e300",
        ] {
            assert!(load(wrong).is_err(), "{wrong}");
        }
    }

    /// An item's box contains its triangles exactly, anywhere in the world.
    #[test]
    fn boxes_hold_their_triangles() {
        for offset in ["0", "1e7", "-123456.789"] {
            let text = format!("mesh:forest:n=5k,offset={offset}");
            let scene = load(&text, &Default::default()).unwrap();
            let surfaces = scene.surfaces.as_ref().unwrap();
            for (item, b) in scene.items.iter().enumerate() {
                let own = surfaces.bounds(item);
                assert!(b.min.cmple(own.min).all() && b.max.cmpge(own.max).all());
            }
        }
    }

    /// Pinned digests of generated meshes.
    ///
    /// Changing a mesh changes every published figure and belongs in the CHANGELOG.
    #[test]
    fn generated_meshes_are_the_published_ones() {
        let digest = |mesh: &Family| {
            let surfaces = mesh.mesh(10_000, 7);
            let mut hash = hmac_sha256::Hash::new();
            let points = surfaces.points.iter().flat_map(|p| p.to_array());
            points.for_each(|x| hash.update(x.to_bits().to_le_bytes()));
            let indices = surfaces.triangles.iter().flatten();
            indices.for_each(|i| hash.update(i.to_le_bytes()));
            hex(&hash.finalize())[..16].to_owned()
        };
        let digests: Vec<_> = MESHES
            .iter()
            .map(|mesh| (mesh.name, digest(mesh)))
            .collect();
        let published = [
            ("mesh:terrain", "18d8c2cac058ffb9"),
            ("mesh:forest", "c6f1b673bedf07cb"),
            ("mesh:spheres", "e3ed4cb5663d010d"),
            ("mesh:statue", "a343985cc3503382"),
        ];
        let published = published.map(|(name, digest)| (name, digest.to_owned()));
        assert_eq!(digests, published);
    }

    #[test]
    fn the_seed_decides_everything() {
        for mesh in MESHES {
            let [a, b, other] = [3, 3, 4].map(|seed| mesh.mesh(5000, seed));
            assert_eq!(a.points, b.points);
            assert_eq!(a.triangles, b.triangles);
            assert_ne!(a.points, other.points, "{}", mesh.name);
        }
    }

    #[test]
    fn closed_meshes_are_watertight_and_no_triangle_is_empty() {
        for mesh in MESHES {
            let surfaces = mesh.mesh(20_000, 11);
            for item in 0..surfaces.items() {
                // Ground is open, and so are the cards of bushes.
                let is_tile = surfaces.of_item[item].len() == ground::TILE;
                let is_bush = surfaces.kinds[surfaces.range(item).start] == SurfaceKind::CutOut;
                if !is_tile && !is_bush {
                    assert_eq!(surfaces.open_edges(item), 0, "{} {item}", mesh.name);
                    assert!(surfaces.volume(item) > 0.0, "{} {item}", mesh.name);
                }
                for [a, b, c] in surfaces.of(item).map(|c| c.map(Vec3::as_dvec3)) {
                    assert!((b - a).cross(c - a).length() > 0.0, "{} {item}", mesh.name);
                }
            }
        }
    }
}
