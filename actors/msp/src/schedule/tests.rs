use super::*;
use crate::{Channel, Sticks};

/// Ticks of a schedule; each question is answered in the tick after it.
struct Line {
    schedule: Schedule,
    now: Duration,
    answers: bool,
    asked: Option<(u16, Version)>,
}

impl Line {
    fn new() -> Self {
        Self {
            schedule: Schedule::new(Duration::ZERO),
            now: Duration::ZERO,
            answers: true,
            asked: None,
        }
    }

    /// With a controller that has said who it is.
    fn identified() -> Self {
        let mut line = Self::new();
        line.run(20, false);
        assert!(line.schedule.is_identified());
        line
    }

    fn tick(&mut self, step: Duration) -> Option<Write> {
        self.now += step;
        if let Some(answer) = self.asked.take().filter(|_| self.answers) {
            self.schedule.answered(self.now, answer, false);
        }
        let write = self.schedule.tick(self.now);
        if let Some(Write::Request(query, version)) = write {
            self.asked = Some((query.command, version));
        }
        write
    }

    /// Ticks for a while; the times at which RC was written, and the questions asked.
    fn run(&mut self, ticks: u32, fresh: bool) -> (Vec<Duration>, Vec<Query>) {
        let (mut rc, mut asked) = (Vec::new(), Vec::new());
        for _ in 0..ticks {
            if fresh {
                self.schedule.set_channels(self.now, channels());
            }
            match self.tick(TICK) {
                Some(Write::Rc(_)) => rc.push(self.now),
                Some(Write::Request(query, _)) => asked.push(query),
                None => {}
            }
        }
        (rc, asked)
    }
}

fn channels() -> SetRawRc {
    SetRawRc::new(Sticks::IDLE, &[Channel::LOW; 4]).expect("4 aux channels")
}

#[test]
fn rc_goes_out_every_20_ms_whatever_is_asked() {
    for answers in [true, false] {
        let mut line = Line::identified();
        line.answers = answers;
        let (rc, _) = line.run(1_000, true);
        assert_eq!(rc.len(), 500);
        assert!(rc.windows(2).all(|it| it[1] - it[0] == RC_PERIOD));
    }
}

/// A defect of the indoor thesis's code: bad input replayed the last sticks for ever.
#[test]
fn sticks_are_repeated_for_100_ms_and_no_longer() {
    let mut line = Line::identified();
    line.run(10, true);
    let given = line.now - TICK;
    let (rc, _) = line.run(100, false);
    let last = rc.last().expect("they are repeated");
    assert!(*last - given < RC_HOLD && *last - given >= RC_HOLD - RC_PERIOD);
    line.schedule.set_channels(line.now, channels());
    assert!(!line.run(2, false).0.is_empty(), "new sticks go out again");
}

#[test]
fn no_sticks_go_out_before_the_controller_has_said_who_it_is() {
    let mut line = Line::new();
    line.answers = false;
    assert_eq!(line.run(100, true).0, []);
    line.answers = true;
    let (rc, asked) = line.run(30, true);
    let first = rc.first().expect("it is known now");
    let features = once::<FeatureConfig>();
    assert!(line.schedule.is_identified() && asked.contains(&features));
    assert!(line.now - *first < 20 * TICK, "{first:?}");
}

#[test]
fn released_sticks_are_not_repeated() {
    let mut line = Line::identified();
    line.run(10, true);
    line.schedule.release();
    assert_eq!(line.run(100, false).0, []);
}

#[test]
fn late_ticks_lower_no_rate() {
    let mut line = Line::identified();
    let mut rc = 0;
    for tick in 0..1_000 {
        line.schedule.set_channels(line.now, channels());
        let late = Duration::from_millis(tick % 7);
        let early = Duration::from_millis((tick + 6) % 7);
        let write = line.tick(TICK + late - early);
        rc += u32::from(matches!(write, Some(Write::Rc(_))));
    }
    let seconds = line.now.as_secs_f64();
    let rate = f64::from(rc) / seconds;
    assert!((49.0..=50.5).contains(&rate), "{rate} Hz");
}

#[test]
fn four_questions_are_outstanding_while_rc_is_sent_and_one_before() {
    let mut line = Line::new();
    line.answers = false;
    line.run(10, false);
    assert_eq!(line.schedule.outstanding.len(), 1);
    let mut line = Line::identified();
    line.answers = false;
    line.run(10, false);
    let (_, asked) = line.run(100, true);
    let seconds = 100 * TICK;
    assert_eq!(
        asked.len() as u128,
        OUTSTANDING_MAX as u128 * seconds.as_millis() / ANSWER_MAX.as_millis()
    );
}

#[test]
fn who_it_is_comes_before_how_it_does() {
    let mut line = Line::new();
    assert!(!line.schedule.is_identified());
    let (_, asked) = line.run(20, true);
    assert_eq!(asked[..6], QUERIES[..6]);
    assert!(line.schedule.is_identified());
}

#[test]
fn every_question_is_asked_as_often_as_it_should_be() {
    let mut line = Line::new();
    let (_, asked) = line.run(1_000, true);
    for query in QUERIES {
        let times = asked.iter().filter(|it| **it == query).count() as f64;
        let expected = query.every.map_or(1.0, |it| 10.0 / it.as_secs_f64());
        assert!(
            times >= 0.85 * expected && times <= 1.0 + expected,
            "{query:?}: {times}"
        );
    }
}

/// How often GPS is asked in 2 s, if these of its answers are refusals.
fn asked_of_gps(is_refused: impl Fn(u32) -> bool) -> u32 {
    let mut line = Line::new();
    line.answers = false;
    let mut asked = 0;
    for _ in 0..200 {
        if let Some(Write::Request(query, _)) = line.tick(TICK) {
            asked += u32::from(query.command == RawGps::COMMAND);
        }
        if let Some(answer) = line.asked.take() {
            let is_refused = answer.0 == RawGps::COMMAND && is_refused(asked);
            let answer = line.schedule.answered(line.now, answer, is_refused);
            assert!(answer.is_some());
        }
    }
    asked
}

#[test]
fn a_question_that_is_refused_three_times_in_a_row_is_not_asked_again() {
    assert_eq!(asked_of_gps(|_| true), 3);
}

#[test]
fn a_refusal_that_is_noise_ends_no_question() {
    let asked = asked_of_gps(|nth| nth % 3 != 0);
    assert!(asked > 20, "{asked}");
}

#[test]
fn a_hastened_question_is_the_next_one_and_keeps_its_rate() {
    let mut line = Line::new();
    line.run(1_003, true);
    line.schedule.hasten::<Status>();
    let (_, asked) = line.run(4, true);
    assert_eq!(asked[0].command, Status::COMMAND);
    let (_, asked) = line.run(1_000, true);
    let of_status = asked.iter().filter(|it| it.command == Status::COMMAND);
    assert!((57..=64).contains(&of_status.count()));
}

#[test]
fn unanswered_questions_count_as_lost() {
    let mut line = Line::new();
    line.answers = false;
    line.run(101, false);
    assert_eq!(line.schedule.lost(), 10, "one each 100 ms");
    assert_eq!(
        line.schedule
            .answered(line.now, (9_999, Version::V1), false),
        None
    );
}

#[test]
fn a_late_answer_answers_no_question_but_shows_for_two_seconds_that_the_controller_is_alive() {
    for (ticks, expected) in [(20, Some(Answered::Late)), (250, None)] {
        let mut line = Line::new();
        line.answers = false;
        line.run(1, false);
        let asked = line.asked.take().expect("a question");
        let later = line.now + TICK * ticks;
        assert_eq!(
            line.schedule.answered(later, (9_999, Version::V1), false),
            None
        );
        assert_eq!(line.schedule.answered(later, asked, false), expected);
    }
}

/// What came of the answers of a minute.
#[derive(Debug, Default)]
struct Tally {
    in_time: usize,
    late: usize,
    /// The tick of the last answer that was late.
    last_late: usize,
}

/// Answers come in order, each this late, but for those that are lost, by the number of their tick. Checks how long each is
/// said to have taken.
fn answered(late: impl Fn(usize) -> Duration, is_lost: impl Fn(usize) -> bool) -> Tally {
    served(Duration::ZERO, true, late, is_lost)
}

/// By a controller that takes this long for each command.
fn served(
    service: Duration,
    gets_rc: bool,
    late: impl Fn(usize) -> Duration,
    is_lost: impl Fn(usize) -> bool,
) -> Tally {
    let mut line = Line::new();
    line.answers = false;
    let (mut tally, mut on_their_way) = (Tally::default(), VecDeque::new());
    let mut is_free = Duration::ZERO;
    for number in 0..6_000 {
        if gets_rc {
            line.schedule.set_channels(line.now, channels());
        }
        if let Some(write) = line.tick(TICK).filter(|_| !is_lost(number)) {
            is_free = is_free.max(line.now) + service;
            if let Write::Request(query, version) = write {
                let answer = (query.command, version);
                on_their_way.push_back((line.now, is_free + late(number), answer));
            }
        }
        while let Some((at, arrives, answer)) = on_their_way.front().copied()
            && arrives <= line.now
        {
            on_their_way.pop_front();
            match line.schedule.answered(line.now, answer, false) {
                Some(Answered::InTime(query, delay)) => {
                    assert_eq!((query.command, delay), (answer.0, line.now - at));
                    tally.in_time += 1;
                }
                Some(Answered::Late) => {
                    tally.late += 1;
                    tally.last_late = number;
                }
                None => {}
            }
        }
    }
    tally
}

#[test]
fn an_answer_is_as_old_as_its_question_however_often_that_was_asked_again() {
    for late_ms in [0, 30, 90] {
        let tally = answered(|_| Duration::from_millis(late_ms), |_| false);
        assert!(
            tally.in_time > 1_500 && tally.late == 0,
            "{late_ms} ms: {tally:?}"
        );
    }
    for late_ms in [120, 130, 200, 500, 1_500] {
        let tally = answered(|_| Duration::from_millis(late_ms), |_| false);
        // One question at a time, for it is never known who it is, so no RC is sent.
        assert!(
            tally.late > 550 && tally.in_time == 0,
            "{late_ms} ms: {tally:?}"
        );
        // The line gets slow after ten seconds.
        let late = |number| Duration::from_millis(if number < 1_000 { 10 } else { late_ms });
        let tally = answered(late, |_| false);
        assert!(
            tally.late > 750 && tally.in_time < 500,
            "{late_ms} ms: {tally:?}"
        );
    }
}

#[test]
fn a_controller_that_serves_few_commands_is_asked_only_as_many() {
    for service_ms in [20, 30, 40, 50, 70, 90] {
        let service = Duration::from_millis(service_ms);
        let tally = served(service, false, |_| Duration::ZERO, |_| false);
        let share = tally.in_time as f64 * service.as_secs_f64() / 60.0;
        let what = format!("{service_ms} ms: {share:.2} of its time, {tally:?}");
        assert!(share > 0.5 && tally.in_time > 8 * tally.late, "{what}");
    }
}

/// Betaflight's simulation serves 70 to 92.
#[test]
fn a_controller_that_serves_72_commands_a_second_answers_in_time_beside_rc() {
    for service_us in [10_000, 11_000, 12_000, 13_000, 13_800] {
        let service = Duration::from_micros(service_us);
        let tally = served(service, true, |_| Duration::ZERO, |_| false);
        let left = 60.0 * (1.0 / service.as_secs_f64() - 50.0);
        let expected = left.min(60.0 * 34.0);
        assert!(
            tally.in_time > 10 * tally.late && tally.in_time as f64 > 0.85 * expected,
            "{service_us} µs: {tally:?} of {expected}"
        );
    }
}

/// With two waiting, heights would come too seldom to find the ground.
#[test]
fn a_line_that_gets_slow_in_flight_brings_as_many_answers() {
    for late_ms in [30, 60, 75] {
        let late = |number| Duration::from_millis(if number < 1_000 { 10 } else { late_ms });
        let tally = answered(late, |_| false);
        assert!(
            tally.in_time > 2_200 && tally.late == 0,
            "{late_ms} ms: {tally:?}"
        );
    }
}

#[test]
fn a_question_counts_as_lost_once_a_later_one_is_answered() {
    let mut line = Line::identified();
    while !line.schedule.outstanding.is_empty() {
        line.run(1, true);
    }
    line.answers = false;
    while line.schedule.outstanding.len() < 2 {
        line.run(1, true);
    }
    let [first, second] = [0, 1].map(|place: usize| line.schedule.outstanding[place].due.query);
    let lost = line.schedule.lost();
    let answer = (line.schedule).answered(line.now, (second.command, Version::V1), false);
    assert!(matches!(answer, Some(Answered::InTime(..))), "{answer:?}");
    assert_eq!(line.schedule.lost(), lost + 1);
    line.answers = true;
    let (_, again) = line.run(20, true);
    assert!(again.contains(&first), "{again:?}");
}

#[test]
fn lost_answers_make_no_later_one_late() {
    for every in [7, 50, 200] {
        for late_ms in [0, 30, 60] {
            let tally = answered(|_| Duration::from_millis(late_ms), |it| it % every == 0);
            let what = format!("{every}, {late_ms} ms: {tally:?}");
            assert!(tally.in_time > 1_200 && tally.late == 0, "{what}");
        }
    }
}

#[test]
fn answers_are_used_again_soon_after_none_came_for_a_while() {
    for ticks in [5, 15, 50, 150, 250, 400] {
        let (from, late) = (1_003, Duration::from_millis(20));
        let tally = answered(|_| late, |it| (from..from + ticks).contains(&it));
        let what = format!("{ticks}: {tally:?}");
        assert!(
            tally.late <= 4 && tally.last_late <= from + ticks + 20,
            "{what}"
        );
        assert!(tally.in_time > 2_000, "{what}");
    }
}

/// 8 channels, or all 18, at 50 Hz with a question in every other tick: bytes a second, 10 bits each.
#[test]
fn a_second_of_writing_fits_115200_baud() {
    let rc = 50 * (6 + 2 * crate::CHANNELS_MAX);
    let questions = 50 * 6;
    assert!((rc + questions) * 10 < 115_200 / 4);
}
