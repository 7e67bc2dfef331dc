//! What is written when: RC first, telemetry in what is left.

use std::collections::VecDeque;
use std::time::Duration;

use crate::{
    Altitude, Analog, ApiVersion, Attitude, BatteryState, BoardInfo, BoxIds, Direction, FcVariant,
    FcVersion, FeatureConfig, Frame, Message, Motor, MotorOutput, RawGps, Rc, SetMotor, SetRawRc,
    Sonar, Status, Version, encode, order,
};

/// A controller reads about one command in this time (`serial_update_rate_hz`, 100 by default).
pub const TICK: Duration = Duration::from_millis(10);
/// From one RC frame to the next: 50 Hz.
pub const RC_PERIOD: Duration = Duration::from_millis(20);
/// How long sticks are repeated after they were last given. Then RC stops, and the controller's own failsafe acts.
pub const RC_HOLD: Duration = Duration::from_millis(100);
/// How long an answer may take before the question counts as lost and is asked again: ten ticks.
const ANSWER_MAX: Duration = Duration::from_millis(100);
/// How many questions may wait for their answers while RC is sent. With one, a line that takes 30 ms each way would bring heights
/// three times a second, too few to hold one.
const OUTSTANDING_MAX: usize = 4;
/// So many may wait if answers come too late. A controller that serves 77 commands a second, as Betaflight's simulation may, answers
/// two in time: RC takes 50.
const OUTSTANDING_MIN: usize = 2;
/// After so many answers in time one more may wait, at first. Each time that a later one is late takes twice as many.
const IN_TIME_MIN: u32 = 16;
/// No more answers in time are asked for.
const IN_TIME_MAX: u32 = 1_024;
/// Time after a question for which its answer shows that the controller lives.
const LATE_MAX: Duration = Duration::from_secs(2);

/// How often in a row a question is refused until it is not asked any more. An altered byte makes an answer a refusal that no
/// checksum finds.
const REFUSALS_MAX: u8 = 3;

/// A question that is asked again and again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Query {
    /// The message's number.
    pub command: u16,
    /// What is sent with it.
    pub payload: &'static [u8],
    /// From one question to the next; `None`: until it is answered once.
    pub every: Option<Duration>,
}

impl Query {
    fn frame(&self, version: Version) -> Frame<'_> {
        Frame {
            version,
            direction: Direction::Request,
            command: self.command,
            flag: 0,
            payload: self.payload,
        }
    }
}

const fn once<M: Message>() -> Query {
    Query {
        command: M::COMMAND,
        payload: &[],
        every: None,
    }
}

const fn every<M: Message>(ms: u64) -> Query {
    Query {
        command: M::COMMAND,
        payload: &[],
        every: Some(Duration::from_millis(ms)),
    }
}

/// The modes beyond the first page.
pub(crate) const FURTHER_BOXES: Query = Query {
    payload: &[1],
    ..once::<BoxIds>()
};

/// Tells all motors this output: the payload.
const fn motors(output: MotorOutput) -> [u8; 16] {
    let [low, high] = output.us().to_le_bytes();
    [
        low, high, low, high, low, high, low, high, low, high, low, high, low, high, low, high,
    ]
}

/// Stops the motors, which a controller turns for ever once it was told to. One that is armed takes no notice.
pub(crate) const STOP_MOTORS: Query = Query {
    payload: &motors(MotorOutput::STOPPED),
    ..once::<SetMotor>()
};

/// Stops motors that turn both ways (`feature 3D`). What stops others turns them backwards at full speed.
pub(crate) const STOP_REVERSIBLE_MOTORS: Query = Query {
    payload: &motors(MotorOutput::CENTRE),
    ..once::<SetMotor>()
};

/// What a link asks: who the controller is, what stops its motors, then how it does. Fewer questions a second than the 50 ticks
/// that RC leaves.
pub const QUERIES: [Query; 15] = [
    once::<ApiVersion>(),
    once::<FcVariant>(),
    once::<FcVersion>(),
    once::<BoardInfo>(),
    once::<BoxIds>(),
    once::<FeatureConfig>(),
    every::<Status>(160),
    every::<Attitude>(80),
    every::<Altitude>(100),
    every::<RawGps>(100),
    every::<Motor>(500),
    every::<BatteryState>(500),
    every::<Rc>(2000),
    every::<Sonar>(2000),
    every::<Analog>(2000),
];

/// What to write in a tick.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Write {
    /// All channels.
    Rc(SetRawRc),
    /// A question, in a frame of this version.
    Request(Query, Version),
}

impl Write {
    /// Appends the frame to `out`.
    pub fn encode(&self, out: &mut Vec<u8>) {
        let encoded = match self {
            Self::Rc(channels) => order(Version::V1, channels, out),
            Self::Request(query, version) => encode(&query.frame(*version), out),
        };
        encoded.expect("all commands fit a frame of version 1");
    }
}

/// A question that is to be asked.
#[derive(Debug, Clone, Copy)]
struct Due {
    at: Duration,
    query: Query,
    /// How often it was refused in a row.
    refusals: u8,
}

/// A question that waits for its answer.
#[derive(Debug, Clone, Copy)]
struct Outstanding {
    due: Due,
    asked: Duration,
}

/// A question in the present version that may be answered yet.
#[derive(Debug, Clone, Copy)]
struct Asked {
    at: Duration,
    command: u16,
}

/// Whether an answer can be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answered {
    /// It answers this question, which was asked that long ago.
    InTime(Query, Duration),
    /// It answers a question that counts as lost, or may: how it was is not how it is now. The controller lives.
    Late,
}

impl Outstanding {
    /// When to ask again. `None`: never.
    fn answered(&self, now: Duration, is_refused: bool) -> Option<Due> {
        let Due {
            at,
            query,
            refusals,
            ..
        } = self.due;
        let (at, refusals) = if is_refused {
            (now, refusals + 1)
        } else {
            // On a grid, so that a late question doesn't lower its rate.
            ((at + query.every?).max(self.asked), 0)
        };
        (refusals < REFUSALS_MAX).then_some(Due {
            at,
            query,
            refusals,
        })
    }
}

/// Decides what is written when. It is told the time, as a duration since any start.
#[derive(Debug)]
pub struct Schedule {
    /// The newest sticks, and when they were given.
    sticks: Option<(Duration, SetRawRc)>,
    rc_due: Duration,
    /// Ties go to the one that waited longest.
    queries: VecDeque<Due>,
    /// The oldest first.
    outstanding: VecDeque<Outstanding>,
    /// Of the frames of questions. Answers have no numbers, but the version of their question. After one that seems to be late
    /// the other version is used, so that what answers an earlier question is not taken for new.
    version: Version,
    /// What was asked in that version, the oldest first. A controller answers in this order, so an answer belongs to the oldest
    /// question that it can answer, and what was asked before is not answered any more.
    asked: VecDeque<Asked>,
    window: Window,
    lost: u64,
}

/// How many questions may wait for their answers while RC is sent.
///
/// Invariant: a late answer makes it smaller, a lost one doesn't.
#[derive(Debug)]
struct Window {
    size: usize,
    /// Answers in time since it changed.
    in_time: u32,
    /// After so many it grows.
    needed: u32,
}

impl Window {
    const FIRST: Self = Self {
        size: OUTSTANDING_MAX,
        in_time: 0,
        needed: IN_TIME_MIN,
    };

    fn answered_in_time(&mut self) {
        self.in_time += 1;
        if self.in_time >= self.needed && self.size < OUTSTANDING_MAX {
            self.size += 1;
            self.in_time = 0;
        }
    }

    fn answered_late(&mut self) {
        self.in_time = 0;
        if self.size > OUTSTANDING_MIN {
            self.size -= 1;
            self.needed = (2 * self.needed).min(IN_TIME_MAX);
        }
    }
}

const fn due(at: Duration, query: Query) -> Due {
    Due {
        at,
        query,
        refusals: 0,
    }
}

impl Default for Schedule {
    fn default() -> Self {
        Self::new(Duration::ZERO)
    }
}

impl Schedule {
    /// A schedule for a port that was just opened: all questions are due.
    #[must_use]
    pub fn new(now: Duration) -> Self {
        Self {
            sticks: None,
            rc_due: now,
            queries: QUERIES.iter().map(|it| due(now, *it)).collect(),
            outstanding: VecDeque::new(),
            version: Version::V1,
            asked: VecDeque::new(),
            window: Window::FIRST,
            lost: 0,
        }
    }

    /// Takes the newest sticks. They go out only once the controller has said who it is: another one may be behind the port.
    pub fn set_channels(&mut self, now: Duration, channels: SetRawRc) {
        self.sticks = Some((now, channels));
    }

    /// Stops RC at once.
    pub fn release(&mut self) {
        self.sticks = None;
    }

    /// Questions that were never answered.
    #[must_use]
    pub fn lost(&self) -> u64 {
        self.lost
    }

    /// The one command of this tick. Ticks are [`TICK`] apart, or later.
    pub fn tick(&mut self, now: Duration) -> Option<Write> {
        if let Some(channels) = self.fresh_sticks(now)
            && now + TICK / 2 >= self.rc_due
        {
            // On a grid, so that late ticks don't lower the rate; after a pause it starts anew.
            let is_on_time = now < self.rc_due + TICK;
            self.rc_due = RC_PERIOD + if is_on_time { self.rc_due } else { now };
            return Some(Write::Rc(channels));
        }
        let query = self.next_query(now)?;
        self.forget(now);
        self.asked.push_back(Asked {
            at: now,
            command: query.command,
        });
        Some(Write::Request(query, self.version))
    }

    fn forget(&mut self, now: Duration) {
        let is_over = |it: &Asked| now.saturating_sub(it.at) >= LATE_MAX;
        while self.asked.front().is_some_and(is_over) {
            self.asked.pop_front();
        }
    }

    /// Whether RC is going out.
    #[must_use]
    pub fn is_sending(&self, now: Duration) -> bool {
        self.fresh_sticks(now).is_some()
    }

    /// Whether the controller has answered, or refused, all that is asked once, but for what stops its motors.
    #[must_use]
    pub fn is_identified(&self) -> bool {
        let waiting = self.outstanding.iter().map(|it| it.due.query);
        let mut open = self.queries.iter().map(|it| it.query).chain(waiting);
        open.all(|query| {
            let is_about_motors = [FeatureConfig::COMMAND, SetMotor::COMMAND];
            query.every.is_some() || is_about_motors.contains(&query.command)
        })
    }

    /// Asks something besides.
    pub(crate) fn ask(&mut self, now: Duration, query: Query) {
        self.queries.push_back(due(now, query));
    }

    /// Asks a question again before all others.
    pub fn hasten<M: Message>(&mut self) {
        let place = (self.queries.iter()).position(|it| it.query.command == M::COMMAND);
        if let Some(mut hastened) = place.and_then(|place| self.queries.remove(place)) {
            let first = self.queries.iter().map(|it| it.at).min();
            hastened.at = first.map_or(hastened.at, |first| first.min(hastened.at));
            self.queries.push_front(hastened);
        }
    }

    fn fresh_sticks(&self, now: Duration) -> Option<SetRawRc> {
        let (given, channels) = self.sticks.filter(|_| self.is_identified())?;
        (now.saturating_sub(given) < RC_HOLD).then_some(channels)
    }

    /// Counts questions as lost that wait for too long.
    fn expire(&mut self, now: Duration) {
        self.lose(now, |asked| now.saturating_sub(asked) >= ANSWER_MAX);
    }

    /// Counts the oldest questions as lost, by when they were asked. They are asked again.
    fn lose(&mut self, now: Duration, is_lost: impl Fn(Duration) -> bool) {
        while let Some(oldest) = self.outstanding.front()
            && is_lost(oldest.asked)
        {
            self.lost += 1;
            self.queries.push_back(Due {
                at: now,
                ..oldest.due
            });
            self.outstanding.pop_front();
        }
    }

    /// While no RC is sent, one question waits at a time, so that a controller that serves few commands a second is in time.
    fn outstanding_max(&self, now: Duration) -> usize {
        match self.is_sending(now) {
            true => self.window.size,
            false => 1,
        }
    }

    fn next_query(&mut self, now: Duration) -> Option<Query> {
        self.expire(now);
        if self.outstanding.len() >= self.outstanding_max(now) {
            return None;
        }
        let first = self.queries.iter().map(|it| it.at).min()?;
        let place = (self.queries.iter()).position(|it| it.at == first && first <= now)?;
        let due = self.queries.remove(place)?;
        self.outstanding.push_back(Outstanding { due, asked: now });
        Some(due.query)
    }

    /// Takes an answer; `None` if nothing was asked in the last two seconds that it can answer. A question that is refused
    /// three times in a row is not asked again.
    pub fn answered(
        &mut self,
        now: Duration,
        (command, version): (u16, Version),
        is_refused: bool,
    ) -> Option<Answered> {
        if version != self.version {
            return Some(Answered::Late);
        }
        self.expire(now);
        self.forget(now);
        let place = (self.asked.iter()).position(|it| it.command == command)?;
        let asked = self.asked.drain(..=place).next_back()?;
        self.lose(now, |before| before < asked.at);
        let waits = |it: &Outstanding| it.due.query.command == command && it.asked == asked.at;
        let outstanding = (self.outstanding.iter().position(waits))
            .and_then(|place| self.outstanding.remove(place));
        let Some(outstanding) = outstanding else {
            self.change_version();
            self.window.answered_late();
            return Some(Answered::Late);
        };
        self.queries.extend(outstanding.answered(now, is_refused));
        self.window.answered_in_time();
        Some(Answered::InTime(
            outstanding.due.query,
            now.saturating_sub(asked.at),
        ))
    }

    /// Two versions do: once one is answered, all answers in the other have come.
    fn change_version(&mut self) {
        self.version = match self.version {
            Version::V1 => Version::V2,
            Version::V2 | Version::V2OverV1 => Version::V1,
        };
        self.asked.clear();
    }
}

#[cfg(test)]
mod tests;
