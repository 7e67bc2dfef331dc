//! The machine that patrols a floor: it keeps track of where the drone is, of what it has seen, flies to what it has not, and
//! keeps clear of what is near.
//!
//! In: ranges and odometry. Out: a velocity, ten times a second; the pose with its covariance, what remains to be seen, and
//! which sonars fail. A long search for a way goes on in the next steps.

mod config;
mod deadlines;
mod flight;
mod guard;
mod legs;
mod place;
mod route;
mod sonars;
#[cfg(test)]
mod tests;

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use muster_machines::indoor::{Builder, Indoor};
use muster_machines::machine::{Machine, Output};
use muster_machines::time::Timestamp;

pub use self::config::{Config, PERIOD, THESIS_SONARS, thesis_sonars};
pub use muster_machines::indoor::{
    Checkpoint, EarlyLanding, Event, Fault, Input, Remaining, SonarChange, Transmit, Velocity,
};

use self::deadlines::Deadlines;
use self::flight::Flight;
use self::place::Place;
use self::route::{Order, Route};
use self::sonars::Sonars;
use crate::coverage::Seen;
use crate::reading::{Echo, Mounting, Reading};

/// Most readings that wait for the next step; the oldest goes first.
const READINGS_MAX: usize = 64;

/// A patrol of one drone.
#[derive(Debug)]
pub struct Patrol {
    config: Config,
    place: Place,
    sonars: Sonars,
    flight: Flight,
    route: Route,
    seen: Seen,
    readings: VecDeque<Reading>,
    next: Timestamp,
    deadlines: Deadlines,
    has_ended: bool,
    outbox: VecDeque<Output<Transmit, Event>>,
}

impl Patrol {
    /// A patrol that begins at `now`, or goes on from a checkpoint. One of another map or camera is ignored.
    #[must_use]
    pub fn new(config: Config, seed: u64, now: Timestamp, checkpoint: Option<&Checkpoint>) -> Self {
        let targets = config.places.targets().len();
        let checkpoint = checkpoint
            .filter(|it| it.targets == config.places.identity() && it.seen.is_of(targets));
        let seen = checkpoint.map_or_else(|| Seen::none(targets), |it| it.seen.clone());
        Self {
            place: Place::new(&config, seed, now, checkpoint),
            sonars: Sonars::new(&config),
            flight: Flight::new(&config),
            route: Route::new(&config),
            seen,
            readings: VecDeque::new(),
            next: now + PERIOD,
            deadlines: Deadlines::new(now, checkpoint),
            has_ended: checkpoint.is_some_and(|it| it.has_ended),
            outbox: VecDeque::new(),
            config,
        }
    }

    /// Builds patrols of one configuration, for a navigation to host.
    #[must_use]
    pub fn builder(config: Config) -> Arc<Builder> {
        Arc::new(move |seed, now, checkpoint| -> Box<dyn Indoor> {
            Box::new(Self::new(config.clone(), seed, now, checkpoint))
        })
    }

    fn event(&mut self, event: Event) {
        self.outbox.push_back(Output::Event(event));
    }

    fn tick(&mut self, now: Timestamp) {
        let at = Duration::from_nanos(now.as_nanos());
        let waited = self.readings.drain(..);
        let readings: Vec<Reading> = waited.filter(|it| at < it.expires).collect();
        let before = self.place.odometry();
        for change in self
            .sonars
            .judge(now, &self.config, self.place.pose(), &readings)
        {
            self.event(Event::Sonar(change));
        }
        let trusted: Vec<Reading> = readings
            .into_iter()
            .filter(|reading| self.sonars.is_trusted(reading))
            .collect();
        self.place.step(now, &trusted);
        self.flight
            .sense(&self.config, &self.place, &self.sonars, (&trusted, before));
        let pose = self.place.pose();
        if !self.place.is_lost() {
            let (map, view) = (self.config.floor.map(), self.config.view);
            self.config
                .places
                .targets()
                .look(map, pose, view, &mut self.seen);
        }
        self.end_helpless(now);
        let order = if self.has_ended {
            Order::Done
        } else if !self.deadlines.has_odometry(now) {
            Order::Wait
        } else if self.place.is_lost() {
            Order::Search
        } else {
            self.route.next(now, &self.config, &self.place, &self.seen)
        };
        self.has_ended |= order == Order::Done;
        if let Order::GiveUp(stop) = order {
            self.event(Event::GivenUp(stop));
        }
        if self.route.was_blocked() {
            self.flight.forget();
        }
        let velocity = self
            .flight
            .velocity(now, &self.config, &self.place, &self.sonars, &order);
        self.outbox
            .push_back(Output::Transmit(Transmit::Velocity(velocity)));
        self.report(now);
    }

    /// Ends the patrol where the drone is if it can't go on: see [`EarlyLanding`].
    fn end_helpless(&mut self, now: Timestamp) {
        if self.sonars.leading_rad(now).is_some() {
            self.deadlines.hear(now);
        }
        let is_lost = self.place.is_lost_for_good();
        let cause = self.deadlines.passed(now, self.config.lasts_max);
        let cause = cause.or_else(|| is_lost.then_some(EarlyLanding::PoseLost));
        if let (Some(cause), false) = (cause, self.has_ended) {
            self.has_ended = true;
            self.event(Event::Landing(cause));
        }
    }

    fn report(&mut self, now: Timestamp) {
        let visible = self.config.places.visible();
        self.event(Event::Remaining(Remaining {
            unseen: self.seen.missing(visible),
            visible: visible.len(),
            is_done: self.has_ended,
        }));
        let checkpoint = Checkpoint {
            at: now,
            pose: self.place.pose(),
            covariance: self.place.covariance().into(),
            is_lost: self.place.is_lost(),
            seen: self.seen.clone(),
            targets: self.config.places.identity(),
            has_ended: self.has_ended,
            unheard: self.deadlines.unheard(now),
            lost: self.place.lost(),
            unmoved: self.deadlines.unmoved(now),
            lasted: self.deadlines.lasted(now),
        };
        self.event(Event::Checkpoint(Box::new(checkpoint)));
    }
}

/// A reading; failed if its range is none that its sensor can measure. An echo from beyond its range is none: some drivers tell
/// of it, and the sensor works.
fn checked(reading: Reading) -> Reading {
    let Mounting {
        range_min_m,
        range_max_m,
        ..
    } = reading.mounting;
    let echo = match reading.echo {
        Echo::At(range_m) if range_m.is_finite() && range_m > range_max_m => Echo::Silence,
        Echo::At(range_m) if !(range_min_m..=range_max_m).contains(&range_m) => Echo::Failed,
        echo => echo,
    };
    Reading { echo, ..reading }
}

impl Machine for Patrol {
    type Input = Input;
    type Transmit = Transmit;
    type Event = Event;

    fn handle_input(&mut self, now: Timestamp, input: Input) {
        match input {
            Input::Odometry(motion) => {
                if self.place.moved(motion) {
                    self.deadlines.moved(now);
                }
            }
            Input::Range(reading) => {
                if self.readings.len() == READINGS_MAX {
                    self.readings.pop_front();
                }
                self.readings.push_back(checked(reading));
            }
        }
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        if now >= self.next {
            self.next = self.next.next_period(PERIOD, now);
            self.tick(now);
        }
    }

    fn poll_output(&mut self) -> Output<Transmit, Event> {
        self.outbox.pop_front().unwrap_or(Output::Idle {
            deadline: Some(self.next),
        })
    }
}
