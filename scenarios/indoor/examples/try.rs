//! dev
use muster_indoor_world::{engine, flat::Flat, world::*};
fn main() {
    let flat = Flat::read(std::path::Path::new("flat")).unwrap();
    let p = Prepared::new(flat, Default::default()).unwrap();
    let config = &p.config;
    println!("{} stops {:?}", config.stops.len(), config.stops);
    let base = engine::run(&p, Setup::undisturbed());
    let show = |name: &str, o: &Outcome| {
        println!(
            "{name}: done {} time {:.1} seen {:.4} clearance {:.3} touches {:?} given up {} sonars {:?} blind {} err p50 {:.3} p95 {:.3} max {:.3}",
            o.is_done,
            o.time.as_secs_f64(),
            o.seen(),
            o.least_clearance_m,
            o.touches,
            o.given_up.len(),
            o.sonars,
            o.blind_motions,
            o.error_m(0.5),
            o.error_m(0.95),
            o.error_m(1.0)
        )
    };
    show("base", &base);
    let n: u64 = std::env::args().nth(1).map_or(3, |s| s.parse().unwrap());
    for seed in 0..n {
        let started = std::time::Instant::now();
        let o = engine::run(&p, {
            let mut s = Setup::seeded(seed);
            s.noise = std::env::var("QUIET").is_err();
            s
        });
        show(
            &format!(
                "{seed} ({:.2} s, x{:.2})",
                started.elapsed().as_secs_f64(),
                o.time.as_secs_f64() / base.time.as_secs_f64()
            ),
            &o,
        );
    }
}
