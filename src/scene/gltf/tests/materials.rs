//! Surfaces by the materials of a file.

use super::*;

#[test]
fn glass_is_clear() {
    let mut glass = file();
    let transmission = json!({"KHR_materials_transmission": {"transmissionFactor": 1}});
    glass["materials"][0] = json!({"extensions": transmission});
    let surfaces = read(&glass).unwrap().surfaces.expect("triangles");
    assert_eq!(surfaces.kinds, [SurfaceKind::Clear; 8]);
    // The factor defaults to 0.
    glass["materials"][0] = json!({"extensions": {"KHR_materials_transmission": {}}});
    let surfaces = read(&glass).unwrap().surfaces.expect("triangles");
    assert_eq!(surfaces.kinds, [SurfaceKind::Opaque; 8]);
}

#[test]
fn a_mask_hides_where_nothing_can_be_cut_out() {
    let mut mask = file();
    let kind = |mask: &Value| read(mask).unwrap().surfaces.expect("triangles").kinds[0];
    let plain = json!({"alphaMode": "MASK"});
    let mut coloured = file();
    coloured["materials"][0] = plain.clone();
    assert_eq!(kind(&coloured), SurfaceKind::Opaque);
    coloured["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(0);
    assert_eq!(kind(&coloured), SurfaceKind::CutOut);
    let mut glossy = file();
    glossy["materials"][0] = plain;
    glossy["materials"][0]["extensions"] = json!({"KHR_materials_pbrSpecularGlossiness": {}});
    assert_eq!(kind(&glossy), SurfaceKind::CutOut);
    for (alpha, kind) in [(1.0, SurfaceKind::Opaque), (0.4, SurfaceKind::CutOut)] {
        let own = json!({"baseColorFactor": [1, 1, 1, alpha]});
        mask["materials"][0] = json!({"alphaMode": "MASK", "pbrMetallicRoughness": own});
        let surfaces = read(&mask).unwrap().surfaces.expect("triangles");
        assert_eq!(surfaces.kinds, [kind; 8]);
    }
}

#[test]
fn each_triangle_has_the_material_of_its_primitive() {
    let mut file = file();
    let mask =
        json!({"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0]}});
    file["materials"] = json!([mask, {"doubleSided": true}, {"alphaMode": "BLEND"}]);
    let primitive = &file["meshes"][0]["primitives"][0];
    let all = [Some(1), Some(0), None, Some(2)].map(|material| {
        let mut own = primitive.clone();
        own["material"] = json!(material);
        own
    });
    file["meshes"][0]["primitives"] = json!(all);
    let scene = read(&file).unwrap();
    let single = scene.clone().by_triangle(&LoadOptions::default()).unwrap();
    let whole = scene.surfaces.as_ref().expect("triangles");
    let solid = whole
        .range(1)
        .filter(|t| [0, 2].contains(&(t / 4 % 4)))
        .map(|t| whole.corners(t as u32));
    assert!(whole.solid_part(1).of(0).eq(solid));
    for surfaces in [scene.surfaces, single.surfaces] {
        let surfaces = surfaces.expect("triangles");
        let (kinds, two_sided) = (surfaces.kinds.chunks(4), surfaces.two_sided.chunks(4));
        let facts = kinds.zip(two_sided).zip((0..4).cycle());
        for ((kinds, two_sided), primitive) in facts {
            let kind = [
                SurfaceKind::Opaque,
                SurfaceKind::CutOut,
                SurfaceKind::Opaque,
                SurfaceKind::Clear,
            ][primitive];
            assert_eq!(
                (kinds, two_sided),
                (&[kind; 4][..], &[primitive == 0; 4][..])
            );
        }
    }
}
