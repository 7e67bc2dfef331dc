//! What reads bytes from outside, a function for each such thing. None may panic, whatever the bytes are.

mod drone;
mod drone_file;
mod echo;
mod flat;
mod frames;
mod journal;
mod lidar;
mod lists;
mod log;
mod map;
mod mission;
mod msp;
mod scenario;

/// A fuzz target: its name, the folder of its seeds within the project, and what it runs on an input.
pub struct Target {
    /// Name in `.ci/fuzz`, and of the program that runs it.
    pub name: &'static str,
    /// Folder of inputs to begin with, from the project's.
    pub seeds: &'static str,
    /// Reads an input. Panics if it is not read as it must be.
    pub run: fn(&[u8]),
}

/// All fuzz targets.
pub const TARGETS: [Target; 13] = [
    target("frames", "fuzz/corpus/frames", frames::run),
    target("drone", "fuzz/corpus/drone", drone::run),
    target("journal", "fuzz/corpus/journal", journal::run),
    target("lists", "fuzz/corpus/lists", lists::run),
    target("mission", "scenarios/missions", mission::run),
    target("scenario", "scenarios", scenario::run),
    target("drone-file", "fuzz/corpus/drone-file", drone_file::run),
    target("msp", "fuzz/corpus/msp", msp::run),
    target("map", "fuzz/corpus/map", map::run),
    target("log", "fuzz/corpus/log", log::run),
    target("flat", "scenarios/indoor/flats", flat::run),
    target("lidar", "fuzz/corpus/lidar", lidar::run),
    target("echo", "fuzz/corpus/echo", echo::run),
];

const fn target(name: &'static str, seeds: &'static str, run: fn(&[u8])) -> Target {
    Target { name, seeds, run }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::panic;
    use std::path::Path;

    use proptest::prelude::*;
    use proptest::sample::Index;
    use proptest::strategy::ValueTree;
    use proptest::test_runner::TestRunner;

    use super::*;

    /// The longest input, as for `.ci/fuzz`.
    const SIZE_MAX: usize = 4_096;
    /// Changed seeds that each target is given.
    const INPUTS: u32 = 2_000;

    /// A change of an input.
    #[derive(Clone, Debug)]
    enum Change {
        Flip(Index, u8),
        Insert(Index, Vec<u8>),
        Remove(Index, usize),
        Truncate(Index),
        Repeat(Index, Index),
    }

    impl Change {
        fn apply(self, bytes: &mut Vec<u8>) {
            let at = |index: &Index, bytes: &[u8]| index.index(bytes.len() + 1);
            match self {
                Self::Flip(_, _) if bytes.is_empty() => {}
                Self::Flip(index, bits) => *index.get_mut(bytes) ^= bits,
                Self::Insert(index, new) => {
                    let at = at(&index, bytes);
                    bytes.splice(at..at, new);
                }
                Self::Remove(index, size) => {
                    let from = at(&index, bytes);
                    bytes.drain(from..bytes.len().min(from + size));
                }
                Self::Truncate(index) => bytes.truncate(at(&index, bytes)),
                Self::Repeat(from, to) => {
                    let (from, to) = (at(&from, bytes), at(&to, bytes));
                    bytes.extend_from_within(from.min(to)..from.max(to));
                }
            }
            bytes.truncate(SIZE_MAX);
        }
    }

    fn changes() -> impl Strategy<Value = Vec<Change>> {
        let change = prop_oneof![
            6 => (any::<Index>(), 1..=u8::MAX).prop_map(|(at, bits)| Change::Flip(at, bits)),
            2 => (any::<Index>(), prop::collection::vec(any::<u8>(), 1..16))
                .prop_map(|(at, new)| Change::Insert(at, new)),
            // Text is made of these.
            2 => (any::<Index>(), "[-+.0-9a-z_=\"\\[\\]\n ]{1,8}")
                .prop_map(|(at, new)| Change::Insert(at, new.into_bytes())),
            2 => (any::<Index>(), 1..32_usize).prop_map(|(at, size)| Change::Remove(at, size)),
            1 => any::<Index>().prop_map(Change::Truncate),
            1 => (any::<Index>(), any::<Index>()).prop_map(|(from, to)| Change::Repeat(from, to)),
        ];
        prop::collection::vec(change, 0..6)
    }

    fn seeds(target: &Target) -> Vec<Vec<u8>> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("..")
            .join(target.seeds);
        let mut paths: Vec<_> = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .filter(|path| path.is_file())
            .collect();
        paths.sort();
        assert!(!paths.is_empty(), "{} has no seeds", target.name);
        paths.iter().map(|path| fs::read(path).unwrap()).collect()
    }

    /// Without coverage to go by; `.ci/fuzz` searches with it.
    #[test]
    fn no_target_panics_on_its_seeds_or_changed_ones() {
        std::thread::scope(|scope| {
            for target in &TARGETS {
                scope.spawn(|| give_changed_seeds(target));
            }
        });
    }

    fn give_changed_seeds(target: &Target) {
        let seeds = seeds(target);
        for seed in &seeds {
            (target.run)(seed);
        }
        let mut runner = TestRunner::deterministic();
        let inputs = (any::<Index>(), changes());
        for _ in 0..INPUTS {
            let (seed, changes) = inputs.new_tree(&mut runner).unwrap().current();
            let mut input = seed.get(&seeds).clone();
            changes
                .into_iter()
                .for_each(|change| change.apply(&mut input));
            let result = panic::catch_unwind(|| (target.run)(&input));
            assert!(
                result.is_ok(),
                "{}: {:?}",
                target.name,
                input.escape_ascii().to_string()
            );
        }
    }
}
