//! Sonars on lines of a GPIO chip: pings on a schedule, edges with the kernel's times.

use std::path::Path;
use std::thread;
use std::time::Duration;

use gpiocdev::Request;
use gpiocdev::line::{EdgeDetection, EdgeKind, Value};
use muster_indoor::reading::{Echo, Mounting, Reading};
use muster_indoor::sensor::{Schedule, ScheduleError, Source};

use super::edges::{ECHO_MAX, EchoTimer, Edge};

/// Length of a trigger; at least 10 µs. Source: *HC-SR04 User Guide*.
const TRIGGER: Duration = Duration::from_micros(12);
/// Most edges that are taken in one go: two for each sonar in ten turns.
const EDGES_MAX: usize = 256;
/// A reading is used for two turns of all sonars.
const TURNS_USED: f64 = 2.0;

/// A sonar's lines and place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wiring {
    /// Line of the chip that sends a ping.
    pub trigger: u32,
    /// Line of the chip that is high until the echo.
    pub echo: u32,
    /// Where the sonar is.
    pub mounting: Mounting,
    /// Whether it looks up or down, so that it disturbs none of the others.
    pub is_vertical: bool,
}

/// Why sonars can't be used.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The lines can't be had: no such chip or line, or another program holds them.
    #[error("can't use the GPIO lines")]
    Lines(#[from] gpiocdev::Error),
    /// They can't be fired as fast as asked.
    #[error(transparent)]
    Schedule(#[from] ScheduleError),
}

/// Sonars on the lines of a chip.
#[derive(Debug)]
pub struct Hcsr04 {
    sonars: Vec<Sonar>,
    schedule: Schedule,
    triggers: Request,
    echoes: Request,
    /// When the next group is due; `None` before the first.
    next: Option<Duration>,
}

#[derive(Debug)]
struct Sonar {
    wiring: Wiring,
    timer: EchoTimer,
    /// When it was fired, if its echo has not ended.
    fired: Option<Duration>,
}

impl Hcsr04 {
    /// Takes the lines of a chip like `/dev/gpiochip0`, and fires each sonar `rate_hz` times a second from the first read on.
    ///
    /// # Errors
    /// If the lines can't be had, or the rate is too high.
    pub fn open(chip: &Path, wirings: &[Wiring], rate_hz: f64) -> Result<Self, OpenError> {
        let axis = |wiring: &Wiring| (!wiring.is_vertical).then_some(wiring.mounting.bearing_rad);
        let axes: Vec<Option<f64>> = wirings.iter().map(axis).collect();
        let schedule = Schedule::new(&axes, rate_hz)?;
        let lines = |of: fn(&Wiring) -> u32| wirings.iter().map(of).collect::<Vec<u32>>();
        let triggers = Request::builder()
            .on_chip(chip)
            .with_consumer("muster")
            .with_lines(&lines(|wiring| wiring.trigger))
            .as_output(Value::Inactive)
            .request()?;
        let echoes = Request::builder()
            .on_chip(chip)
            .with_consumer("muster")
            .with_lines(&lines(|wiring| wiring.echo))
            .as_input()
            .with_edge_detection(EdgeDetection::BothEdges)
            .request()?;
        let sonar = |wiring: &Wiring| Sonar {
            wiring: *wiring,
            timer: EchoTimer::default(),
            fired: None,
        };
        Ok(Self {
            sonars: wirings.iter().map(sonar).collect(),
            schedule,
            triggers,
            echoes,
            next: None,
        })
    }

    /// Sends the edges that came to their sonars.
    fn take_edges(&mut self) -> Result<(), gpiocdev::Error> {
        for _ in 0..EDGES_MAX {
            if !self.echoes.has_edge_event()? {
                break;
            }
            let event = self.echoes.read_edge_event()?;
            let mut sonars = self.sonars.iter_mut();
            if let Some(sonar) = sonars.find(|sonar| sonar.wiring.echo == event.offset) {
                sonar.timer.edge(Edge {
                    at: Duration::from_nanos(event.timestamp_ns),
                    is_rising: event.kind == EdgeKind::Rising,
                });
            }
        }
        Ok(())
    }

    /// Fires the group that is due.
    fn fire(&mut self, now: Duration) -> Result<(), gpiocdev::Error> {
        let due = *self.next.get_or_insert(now);
        if now < due {
            return Ok(());
        }
        let firing = self.schedule.next(due);
        // After a stall, missed turns are skipped.
        self.next = Some(firing.at.max(now) + self.schedule.slot());
        for sonar in self.schedule.group(firing.group) {
            let sonar = &mut self.sonars[*sonar];
            sonar.timer.restart();
            sonar.fired = Some(now);
            self.triggers
                .set_value(sonar.wiring.trigger, Value::Active)?;
        }
        thread::sleep(TRIGGER);
        for sonar in self.schedule.group(firing.group) {
            let trigger = self.sonars[*sonar].wiring.trigger;
            self.triggers.set_value(trigger, Value::Inactive)?;
        }
        Ok(())
    }
}

impl Sonar {
    /// The reading, once it is there or no longer to be expected.
    fn reading(&mut self, now: Duration, used: Duration) -> Option<Reading> {
        let fired = self.fired?;
        let is_overdue = now.saturating_sub(fired) > ECHO_MAX;
        let echo = self.timer.echo().or(is_overdue.then_some(Echo::Failed))?;
        self.fired = None;
        Some(Reading {
            mounting: self.wiring.mounting,
            echo,
            taken: fired,
            expires: fired + used,
        })
    }
}

impl Source for Hcsr04 {
    type Error = gpiocdev::Error;

    /// Fires the sonars that are due, too: call it at least once in a [`Schedule::slot`].
    fn read(&mut self, now: Duration, readings: &mut Vec<Reading>) -> Result<(), Self::Error> {
        self.take_edges()?;
        let used = Duration::from_secs_f64(TURNS_USED / self.schedule.rate_hz());
        let sonars = self.sonars.iter_mut();
        readings.extend(sonars.filter_map(|sonar| sonar.reading(now, used)));
        self.fire(now)
    }
}
