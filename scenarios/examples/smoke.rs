//! x
use muster_scenarios::engine::{Engine, run};
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let o: Vec<_> = a[3..].iter().map(|s| s.parse().unwrap()).collect();
    let s = muster_scenarios::scenario::load(a[1].as_ref(), &o).unwrap();
    let e = if a[2] == "a" { Engine::Actors } else { Engine::Events };
    let (r, _) = run(&s, e, None).unwrap();
    println!("{}", serde_json::to_string(&r).unwrap());
}
