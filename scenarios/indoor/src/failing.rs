//! How sonars of the world fail.

use muster_indoor::reading::Echo;

/// What a stuck sonar reports, in metres.
const STUCK_M: f64 = 0.05;

/// How a sonar fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Failing {
    /// It doesn't answer.
    Dead,
    /// It reports 5 cm.
    Stuck,
    /// It looks at glass: nothing comes back.
    Glass,
}

impl Failing {
    /// All kinds.
    pub const ALL: [Self; 3] = [Self::Dead, Self::Stuck, Self::Glass];

    /// Its name in commands.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Dead => "dead",
            Self::Stuck => "stuck",
            Self::Glass => "glass",
        }
    }

    /// What the sonar reports; `None` if it doesn't answer.
    pub(crate) const fn echo(self) -> Option<Echo> {
        match self {
            Self::Dead => None,
            Self::Stuck => Some(Echo::At(STUCK_M)),
            Self::Glass => Some(Echo::Silence),
        }
    }
}
