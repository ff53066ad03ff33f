//! The shortest useful program: the ids of the buildings that a camera sees, and
//! the ids of those that contain it.

use cullbench::camera::{Camera, Lens, PlaneOptions, look_at};
use cullbench::index::{Bvh, FrustumQuery, Input, RegionIndex};
use cullbench::scene;
use glam::DVec3;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let city = scene::load("city:n=50000,seed=7", &Default::default())?;
    let bvh = Bvh::build(&Input::new(&city.items), &Default::default())?;

    let frame = look_at(DVec3::new(-300.0, -300.0, 120.0), DVec3::ZERO, DVec3::Z)?;
    let lens = Lens::perspective(60.0, 16.0 / 9.0, 0.5, Some(800.0))?;
    let mut camera = Camera { frame, lens };

    // Fly ahead and bank, as the lectures do.
    for step in 0..4 {
        let volume = camera.volume(&PlaneOptions::default(), &city.surroundings())?;
        let (visible, cost) = bvh.counted(&volume);
        println!(
            "step {step}: {} of {} visible; {} nodes and {} items looked at, {} accepted unseen",
            visible.len(),
            city.items.len(),
            cost.nodes_tested,
            cost.items_tested,
            cost.items_accepted_untested
        );
        camera.frame.advance(60.0);
        camera.frame.roll(10.0);
        camera.frame.pitch(-3.0);
    }

    // Region search: walk into the first house.
    let inside = city.items[0].centre();
    let houses = bvh.locate(inside).len();
    println!("{houses} item(s) hold the point {inside}");
    Ok(())
}
