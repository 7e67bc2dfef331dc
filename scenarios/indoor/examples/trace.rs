//! dev
use muster_indoor_world::{engine, flat::Flat, world::*};
fn main() {
    let flat = Flat::read(std::path::Path::new("flat")).unwrap();
    let p = Prepared::new(flat, Default::default()).unwrap();
    let config = &p.config;
    let o = engine::run(&p, Setup::undisturbed());
    for s in o.track.iter().take(140) {
        println!(
            "{:.1} {:.2} {:.2} {:.0}",
            s.at.as_secs_f64(),
            s.pose.at.x_m,
            s.pose.at.y_m,
            s.pose.heading_rad.to_degrees()
        );
    }
}
