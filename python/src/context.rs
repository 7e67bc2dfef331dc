//! What an agent in Python can read and do.
//!
//! Reads show the drone as it is when the method is called. What the agent asks for is collected, and carried out once the
//! method returns. Of a method that raises, nothing is carried out.

use std::time::Duration;

use muster::agent::{
    self, Destination, MESSAGE_FRAME_MAX, MESSAGE_MAX, MESSAGES_PER_STEP_MAX, Reliability,
    TIMERS_MAX, TimerId,
};
use muster::{Ned, NodeId, Velocity};
use pyo3::exceptions::{PyRuntimeError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

/// A place: metres north of home, east of home and above home.
pub(crate) type Place = (f64, f64, f64);

/// A place in muster's frame as a tuple.
pub(crate) fn place(at: Ned) -> Place {
    (at.north_m(), at.east_m(), at.altitude_m())
}

fn ned((north_m, east_m, altitude_m): Place) -> PyResult<Ned> {
    if [north_m, east_m, altitude_m]
        .iter()
        .all(|it| it.is_finite())
    {
        Ok(Ned::new(north_m, east_m, -altitude_m))
    } else {
        Err(PyValueError::new_err(
            "a place has three finite numbers: north, east, altitude",
        ))
    }
}

/// What the agent asked for.
pub(crate) enum Command {
    GoTo(Ned),
    Track(Ned, Velocity),
    Hold,
    Leave,
    Land,
    Send {
        token: u32,
        to: Destination,
        payload: Vec<u8>,
        reliability: Reliability,
    },
    SetTimer(TimerId, Duration),
    CancelTimer(TimerId),
    SetTelemetry(Option<Duration>),
    Keep(Vec<u8>),
    Observe(String, f64),
}

/// What the agent asked for, in order.
///
/// Invariant: each message has the number after that of the one before. There are at most [`MESSAGES_PER_STEP_MAX`] messages,
/// and at most [`TIMERS_MAX`] timers run.
pub(crate) struct Commands {
    asked: Vec<Command>,
    /// Number of the next message.
    next_token: u32,
    /// Messages so far.
    messages: usize,
    /// Timers that run.
    timers: Vec<TimerId>,
    /// Whether the agent's method has returned.
    is_closed: bool,
}

impl Commands {
    const fn new(next_token: u32, timers: Vec<TimerId>) -> Self {
        Self {
            asked: Vec::new(),
            next_token,
            messages: 0,
            timers,
            is_closed: false,
        }
    }

    fn push(&mut self, command: Command) -> PyResult<()> {
        self.check_open()?;
        self.asked.push(command);
        Ok(())
    }

    fn check_open(&self) -> PyResult<()> {
        if self.is_closed {
            let message = "this context belongs to an earlier call; use the one of this call";
            return Err(PyRuntimeError::new_err(message));
        }
        Ok(())
    }

    /// Sends a message. Returns its number.
    fn send(&mut self, to: Destination, payload: &[u8], reliability: Reliability) -> PyResult<u32> {
        self.check_open()?;
        if self.messages >= MESSAGES_PER_STEP_MAX {
            let message =
                format!("an agent may send at most {MESSAGES_PER_STEP_MAX} messages in one call");
            return Err(PyValueError::new_err(message));
        }
        self.messages += 1;
        let token = self.next_token;
        self.next_token = token.wrapping_add(1);
        self.push(Command::Send {
            token,
            to,
            payload: payload.to_vec(),
            reliability,
        })?;
        Ok(token)
    }

    /// Starts a timer, or restarts it.
    fn set_timer(&mut self, timer: TimerId, after: Duration) -> PyResult<()> {
        self.check_open()?;
        if !self.timers.contains(&timer) {
            if self.timers.len() >= TIMERS_MAX {
                let message = format!("{TIMERS_MAX} timers run; accepted are at most {TIMERS_MAX}");
                return Err(PyValueError::new_err(message));
            }
            self.timers.push(timer);
        }
        self.push(Command::SetTimer(timer, after))
    }

    /// Stops a timer.
    fn cancel_timer(&mut self, timer: TimerId) -> PyResult<()> {
        self.timers.retain(|running| *running != timer);
        self.push(Command::CancelTimer(timer))
    }

    /// Yields what was asked for. From now on nothing can be.
    pub(crate) fn close(&mut self) -> Vec<Command> {
        self.is_closed = true;
        std::mem::take(&mut self.asked)
    }
}

/// What an agent can read and do.
#[pyclass(module = "muster")]
pub(crate) struct Context {
    /// Time since the start of the run, in seconds.
    #[pyo3(get)]
    now: f64,
    /// Number of this drone.
    #[pyo3(get)]
    id: u32,
    /// Number of drones at take-off.
    #[pyo3(get)]
    drones: u32,
    /// Drones on task, as far as is known.
    #[pyo3(get)]
    drones_on_task: Vec<u32>,
    /// The current leader.
    #[pyo3(get)]
    leader: u32,
    /// The drone's slot.
    #[pyo3(get)]
    slot: Place,
    /// The drone's last known position.
    #[pyo3(get)]
    position: Place,
    /// Highest altitude that an agent may fly to, in metres above home.
    #[pyo3(get)]
    altitude_max_m: f64,
    /// Waypoints of the mission file.
    #[pyo3(get)]
    waypoints: Vec<Place>,
    kept: Option<Vec<u8>>,
    /// `agent.parameters` of the scenario.
    #[pyo3(get)]
    parameters: Py<PyDict>,
    /// A `random.Random`, seeded by the run.
    #[pyo3(get)]
    rng: Py<PyAny>,
    pub(crate) commands: Commands,
}

impl Context {
    pub(crate) fn new(
        context: &agent::Context<'_>,
        (parameters, rng): (Py<PyDict>, Py<PyAny>),
        next_token: u32,
    ) -> Self {
        Self {
            now: context.now().as_secs_f64(),
            id: context.id().0,
            drones: context.drones(),
            drones_on_task: context.drones_on_task().iter().map(|id| id.0).collect(),
            leader: context.leader().0,
            slot: place(context.slot()),
            position: place(context.position()),
            altitude_max_m: context.altitude_max_m(),
            waypoints: context.waypoints().iter().copied().map(place).collect(),
            kept: context.kept().map(<[u8]>::to_vec),
            parameters,
            rng,
            commands: Commands::new(next_token, context.timers().collect()),
        }
    }
}

#[pymethods]
impl Context {
    /// Whether this drone leads the swarm.
    #[getter]
    fn is_leader(&self) -> bool {
        self.leader == self.id
    }

    /// The state kept before a restart, or None.
    #[getter]
    fn kept<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyBytes>> {
        self.kept.as_ref().map(|kept| PyBytes::new(py, kept))
    }

    /// Flies straight to a place (metres north, east, above home) and holds there.
    fn go_to(&mut self, place: Place) -> PyResult<()> {
        self.commands.push(Command::GoTo(ned(place)?))
    }

    /// Follows a place that moves at a velocity (metres per second north, east, up). Repeat it at least once a second.
    fn track(&mut self, place: Place, velocity: Place) -> PyResult<()> {
        let velocity = Velocity(ned(velocity)?.0);
        self.commands.push(Command::Track(ned(place)?, velocity))
    }

    /// Comes to rest.
    fn hold(&mut self) -> PyResult<()> {
        self.commands.push(Command::Hold)
    }

    /// Leaves the swarm: no heartbeats, no leader, no elections; messages as before. It can't return.
    fn leave(&mut self) -> PyResult<()> {
        self.commands.push(Command::Leave)
    }

    /// Descends on the spot and disarms. The agent is not called any more.
    fn land(&mut self) -> PyResult<()> {
        self.commands.push(Command::Land)
    }

    /// Sends bytes to "leader", "neighbours", "all" or a drone's number. Returns the message's number.
    #[pyo3(signature = (to, payload, acknowledged = false))]
    fn send(&mut self, to: &Bound<'_, PyAny>, payload: &[u8], acknowledged: bool) -> PyResult<u32> {
        let to = destination(to)?;
        let max = match to {
            Destination::All | Destination::Neighbours => MESSAGE_FRAME_MAX,
            Destination::Leader | Destination::Drone(_) => MESSAGE_MAX,
        };
        if payload.len() > max {
            let len = payload.len();
            let message = format!("{len} bytes are too many; accepted are at most {max}");
            return Err(PyValueError::new_err(message));
        }
        let reliability = if acknowledged {
            Reliability::Acknowledged
        } else {
            Reliability::BestEffort
        };
        self.commands.send(to, payload, reliability)
    }

    /// Starts a timer with a number of one's own, or restarts it.
    fn set_timer(&mut self, timer: u32, seconds: f64) -> PyResult<()> {
        let after = Duration::try_from_secs_f64(seconds)
            .map_err(|_| PyValueError::new_err("`seconds` is a number from 0"))?;
        self.commands.set_timer(TimerId(timer), after)
    }

    /// Calls `telemetry` once in so many seconds, at least 0.01; None: on arrival only.
    fn set_telemetry(&mut self, seconds: Option<f64>) -> PyResult<()> {
        let period = seconds.map(Duration::try_from_secs_f64).transpose();
        let period =
            period.map_err(|_| PyValueError::new_err("`seconds` is a number from 0, or None"))?;
        self.commands.push(Command::SetTelemetry(period))
    }

    /// Stops a timer.
    fn cancel_timer(&mut self, timer: u32) -> PyResult<()> {
        self.commands.cancel_timer(TimerId(timer))
    }

    /// Keeps bytes for the case of a restart.
    fn keep(&mut self, kept: &[u8]) -> PyResult<()> {
        if kept.len() > agent::KEPT_MAX {
            let (len, max) = (kept.len(), agent::KEPT_MAX);
            let message = format!("{len} bytes are too many; accepted are at most {max}");
            return Err(PyValueError::new_err(message));
        }
        self.commands.push(Command::Keep(kept.to_vec()))?;
        self.kept = Some(kept.to_vec());
        Ok(())
    }

    /// Reports a named number to observers.
    fn observe(&mut self, name: &str, value: f64) -> PyResult<()> {
        self.commands.push(Command::Observe(name.to_owned(), value))
    }
}

fn destination(to: &Bound<'_, PyAny>) -> PyResult<Destination> {
    if let Ok(id) = to.extract::<u32>() {
        return Ok(Destination::Drone(NodeId(id)));
    }
    match to.extract::<&str>() {
        Ok("leader") => Ok(Destination::Leader),
        Ok("neighbours") => Ok(Destination::Neighbours),
        Ok("all") => Ok(Destination::All),
        _ => Err(PyTypeError::new_err(
            "`to` is \"leader\", \"neighbours\", \"all\" or a drone's number",
        )),
    }
}
