//! A drone's link and the simulated controller together, on a virtual clock.

use std::iter;
use std::time::Duration;

use muster_controller::{
    CHANNELS, Config, Controller, Fault, PoseErrors, PoseSensor, Settings, Truth, Version,
};
use muster_machines::geometry::Ned;
use muster_machines::machine::{Machine, Output};
use muster_machines::motion::Landing;
use muster_machines::msp::controller::{self, Gains, Noise, PlaceSensor, Receiver, Stage};
use muster_machines::msp::{
    ControllerLink, Event, FlightCommand, Input, PortEvent, Setpoint, Telemetry, Transmit,
};
use muster_machines::time::Timestamp;
use muster_msp::{Conversation, Decoder, SetRawRc, TICK};

/// The pilot's transmitter with ANGLE on: AUX1 arms, AUX3 gives MSP the sticks.
fn pilot(is_armed: bool) -> [u16; CHANNELS] {
    let mut channels = [1_500; CHANNELS];
    let switch = |is_on| if is_on { 1_900 } else { 1_000 };
    (channels[3], channels[4]) = (1_000, switch(is_armed));
    (channels[5], channels[6]) = (1_800, switch(is_armed));
    channels
}

/// A drone's link, its port and its controller.
pub(crate) struct Flown<Link> {
    receiver: Receiver,
    pub(crate) link: Link,
    conversation: Conversation,
    decoder: Decoder,
    controller: Controller,
    pose: Option<PoseSensor>,
    now: Timestamp,
    is_identified: bool,
    /// Whether bytes reach the controller, and its bytes the link.
    pub(crate) is_connected: bool,
    /// Newest telemetry of the link for the navigation.
    telemetry: Option<Telemetry>,
}

impl<Link: Machine<Input = Input, Transmit = Transmit, Event = Event>> Flown<Link> {
    /// In flight, 20 m up or nearly so, with the failsafe's delay in 0.1 s.
    pub(crate) fn new(
        receiver: Receiver,
        delay_ds: u8,
        pose: Option<PoseErrors>,
        simulated: impl FnOnce(Settings) -> Config,
        link: impl FnOnce(ControllerLink) -> Link,
    ) -> Self {
        let mut settings = match receiver {
            Receiver::Sole => Settings::sole(),
            Receiver::Override => Settings::overriding(Version {
                major: 26,
                minor: 6,
                patch: 0,
            }),
        };
        settings.failsafe = Settings::fit().failsafe;
        settings.failsafe.delay_ds = delay_ds;
        let simulated = simulated(settings);
        let config = controller::Config {
            stage: Stage::Sim,
            receiver,
            home: simulated.origin,
            landing: Landing {
                descent_mps: 1.5,
                final_mps: 0.5,
                final_altitude_m: 10.0,
                acceleration_mps2: 1.0,
            },
            place: pose.map_or(PlaceSensor::Gps, |_| PlaceSensor::Pose),
            flow: None,
            noise: Noise::GPS,
            gains: Gains::QUADCOPTER,
        };
        let mut flown = Self {
            receiver,
            link: link(ControllerLink::new(config, None, Timestamp::ZERO)),
            conversation: Conversation::default(),
            decoder: Decoder::default(),
            controller: Controller::new(simulated, 1, Timestamp::ZERO),
            pose: pose.map(|it| PoseSensor::new(it, 1, Timestamp::ZERO)),
            now: Timestamp::ZERO,
            is_identified: false,
            is_connected: true,
            telemetry: None,
        };
        flown.take_off();
        flown
    }

    fn take_off(&mut self) {
        self.give_pilot(Some(false));
        self.run(Duration::from_millis(6_000));
        self.command(FlightCommand::Arm);
        self.give_pilot(Some(true));
        self.run_until("armed", |it| {
            it.telemetry.is_some_and(|telemetry| telemetry.armed)
        });
        self.command(FlightCommand::Fly(Setpoint::Leg {
            to: Ned::new(0.0, 0.0, -20.0),
            speed_mps: 2.0,
            acceleration_mps2: 1.0,
        }));
        self.run(Duration::from_secs(12));
        let truth = self.truth();
        assert!(truth.position.altitude_m() > 15.0, "{truth:?}");
        assert!(!self.is_landing());
    }

    /// The pilot's transmitter is on, with its switches so, or off (`None`). A sole receiver hears none.
    fn give_pilot(&mut self, is_armed: Option<bool>) {
        if self.receiver == Receiver::Override {
            let channels = is_armed.map(pilot);
            self.controller.pilot(self.now, channels.as_ref());
        }
    }

    pub(crate) fn truth(&mut self) -> Truth {
        self.controller.aircraft(self.now)
    }

    pub(crate) fn is_landing(&self) -> bool {
        self.telemetry.is_some_and(|it| it.landing)
    }

    pub(crate) fn command(&mut self, command: FlightCommand) {
        self.give(Input::FlightCommand(command));
    }

    fn give(&mut self, input: Input) {
        self.link.handle_input(self.now, input);
        self.drain();
    }

    fn drain(&mut self) {
        loop {
            match self.link.poll_output() {
                Output::Transmit(Transmit::Rc(rc)) => self.set_rc(rc),
                Output::Transmit(Transmit::Telemetry(telemetry)) => {
                    self.telemetry = Some(telemetry);
                }
                Output::Transmit(_) | Output::Event(_) => {}
                Output::Idle { .. } => return,
            }
        }
    }

    fn set_rc(&mut self, rc: Option<SetRawRc>) {
        let now = self.now.since(Timestamp::ZERO);
        match rc {
            Some(rc) => self.conversation.set_channels(now, rc),
            None => self.conversation.release(),
        }
    }

    /// A tick of the port.
    pub(crate) fn tick(&mut self) {
        self.now += TICK;
        let now = self.now.since(Timestamp::ZERO);
        let bytes = self.controller.transmit(self.now);
        let mut events = Vec::new();
        if self.is_connected {
            self.decoder.read(&bytes, |frame| {
                if let Some(Ok(Some(telemetry))) =
                    self.conversation.take(now, &frame).map(|it| it.content)
                {
                    events.push(PortEvent::Telemetry(telemetry));
                }
            });
        }
        if !self.is_identified
            && let Some(identity) = self.conversation.identity().cloned()
        {
            self.is_identified = true;
            let identity = Box::new(identity);
            let granted = Stage::Bench;
            events.insert(0, PortEvent::Identified { identity, granted });
        }
        let place = self.truth().position;
        if let Some(sensor) = &mut self.pose {
            sensor.measure(self.now, place);
            events.extend(iter::from_fn(|| sensor.arrived(self.now)).map(PortEvent::Pose));
        }
        for event in events {
            self.give(Input::Port(event));
        }
        self.link.handle_timeout(self.now);
        self.drain();
        if let Some(write) = self.conversation.tick(now) {
            let mut bytes = Vec::new();
            write.encode(&mut bytes);
            if self.is_connected {
                self.controller.receive(self.now, &bytes);
            }
        }
    }

    pub(crate) fn run(&mut self, span: Duration) {
        let end = self.now + span;
        while self.now < end {
            self.tick();
        }
    }

    /// Returns how long it took, in ms.
    pub(crate) fn run_until(
        &mut self,
        what: &str,
        mut holds: impl FnMut(&mut Self) -> bool,
    ) -> u64 {
        let since = self.now;
        while !holds(self) {
            self.tick();
            assert!(self.now.since(since) < Duration::from_secs(90), "{what}");
        }
        u64::try_from(self.now.since(since).as_millis()).unwrap()
    }

    /// The controller hears nobody any more, but still answers: RC fails alone. Or the pilot's transmitter is switched off.
    pub(crate) fn lose_receiver(&mut self) {
        match self.receiver {
            Receiver::Sole => self.controller.fault(self.now, Fault::Deaf(true)),
            Receiver::Override => self.give_pilot(None),
        }
    }

    /// The pilot's transmitter is as it was: with the arm switch on.
    pub(crate) fn recover_receiver(&mut self) {
        self.controller.fault(self.now, Fault::Deaf(false));
        self.give_pilot(Some(true));
    }

    /// The drone is down and disarmed; a link that is back for a minute arms nothing, whatever the drone is ordered.
    pub(crate) fn assert_stays_disarmed(&mut self) {
        for _ in 0..60 {
            self.command(FlightCommand::Arm);
            self.run(Duration::from_secs(1));
            assert!(!self.truth().is_armed, "{:?}", self.receiver);
        }
    }
}
