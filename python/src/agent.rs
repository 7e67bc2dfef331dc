//! An agent in Python behind the trait of agents.

use std::collections::{BTreeMap, VecDeque};
use std::panic::resume_unwind;
use std::sync::Arc;

use muster::agent::{self, Agent, Destination, MessageId, Outcome, Reliability, TimerId};
use muster::{AgentSpec, NodeId};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyTuple};
use rand::RngExt;
use serde::Deserialize;

use crate::context::{Command, Context, Place, place};
use crate::interrupt::Interrupt;

/// A drone's motion.
#[pyclass(module = "muster", frozen, get_all)]
pub(crate) struct Telemetry {
    /// Metres north of home, east of home and above home.
    position: Place,
    /// Metres per second north, east and up.
    velocity: Place,
    /// Whether the drone has just come to rest at the destination of `go_to`: true once for each call of it.
    has_arrived: bool,
}

/// A change in the swarm.
#[pyclass(module = "muster", frozen, get_all)]
pub(crate) struct SwarmEvent {
    /// "leader_changed", "leader_silent", "leader_returned", "members_lost", "members_joined", "message_delivered",
    /// "message_expired" or "message_dropped".
    kind: &'static str,
    /// The drones that it is about: the new leader, or members.
    drones: Vec<u32>,
    /// The message that it is about. `None` if that was sent without acknowledgement before 1,024 others.
    message: Option<u32>,
    /// Why it was dropped.
    reason: Option<String>,
}

/// An object with some of the methods `start`, `telemetry`, `message`, `timer` and `swarm`.
pub(crate) struct PyAgent {
    object: Py<PyAny>,
    parameters: Py<PyDict>,
    rng: Option<Py<PyAny>>,
    /// Number of the next message, for Python.
    next_token: u32,
    tokens: Tokens,
    interrupt: Arc<Interrupt>,
}

/// A value in `[agent.parameters]`.
#[derive(Deserialize, IntoPyObject)]
#[serde(untagged)]
enum Parameter {
    Truth(bool),
    Integer(i64),
    Float(f64),
    Text(String),
    List(Vec<Self>),
    Table(BTreeMap<String, Self>),
}

/// The methods of an agent.
const METHODS: [&str; 5] = ["start", "telemetry", "message", "timer", "swarm"];

/// Most messages of either kind whose numbers are remembered. Fewer than these that are to be acknowledged can be under way:
/// the routing refuses further ones.
const TOKENS_MAX: usize = 1_024;

/// Python's numbers of messages whose outcome may come, in the order in which they were sent.
#[derive(Default)]
struct Tokens {
    /// Of messages that have an outcome.
    acknowledged: VecDeque<(MessageId, u32)>,
    /// Of messages that have an outcome only if they are lost.
    best_effort: VecDeque<(MessageId, u32)>,
}

impl Tokens {
    /// Remembers a message, instead of the oldest of its kind if there are too many.
    fn insert(&mut self, id: MessageId, token: u32, is_acknowledged: bool) {
        let tokens = if is_acknowledged {
            &mut self.acknowledged
        } else {
            &mut self.best_effort
        };
        if tokens.len() >= TOKENS_MAX {
            tokens.pop_front();
        }
        tokens.push_back((id, token));
    }

    /// Yields a message's number, and forgets it.
    fn remove(&mut self, id: MessageId) -> Option<u32> {
        let kinds = [&mut self.acknowledged, &mut self.best_effort];
        kinds.into_iter().find_map(|tokens| {
            let at = tokens.iter().position(|(it, _)| *it == id)?;
            tokens.remove(at).map(|(_, token)| token)
        })
    }
}

impl PyAgent {
    /// Calls `new(id)`.
    pub(crate) fn new(
        new: &Py<PyAny>,
        spec: &AgentSpec,
        interrupt: &Arc<Interrupt>,
    ) -> Result<Self, String> {
        let parameters: BTreeMap<String, Parameter> =
            spec.parameters().map_err(|error| error.to_string())?;
        Python::attach(|py| {
            let build = || -> PyResult<Self> {
                let parameters = parameters.into_pyobject(py)?.unbind();
                let object = new.call1(py, (spec.id.0,))?;
                check(object.bind(py), spec.id)?;
                Ok(Self {
                    object,
                    parameters,
                    rng: None,
                    next_token: 0,
                    tokens: Tokens::default(),
                    interrupt: Arc::clone(interrupt),
                })
            };
            build().map_err(|error| {
                let traceback = traceback(py, &error);
                if Interrupt::takes(py, &error) {
                    interrupt.raise(error);
                }
                traceback
            })
        })
    }

    /// Calls a method if the object has it, then carries out what it asked for. Lands once runs are to end.
    fn call<F>(&mut self, context: &mut agent::Context<'_>, name: &str, arguments: F)
    where
        F: for<'py> FnOnce(Python<'py>) -> PyResult<Vec<Bound<'py, PyAny>>>,
    {
        if self.interrupt.is_raised() {
            return context.land();
        }
        let called = Python::attach(|py| {
            let call = || -> PyResult<Vec<Command>> {
                let object = self.object.bind(py);
                if !object.hasattr(name)? {
                    return Ok(Vec::new());
                }
                let rng = match &self.rng {
                    Some(rng) => rng.clone_ref(py),
                    None => {
                        let seed = muster_seed(context);
                        let rng = py.import("random")?.call_method1("Random", (seed,))?;
                        self.rng.insert(rng.unbind()).clone_ref(py)
                    }
                };
                let own = (self.parameters.clone_ref(py), rng);
                let cx = Bound::new(py, Context::new(context, own, self.next_token))?;
                let mut arguments = arguments(py)?;
                arguments.push(cx.clone().into_any());
                let called = object.call_method1(name, PyTuple::new(py, arguments)?);
                let commands = cx.borrow_mut().commands.close();
                called.map(|_| commands)
            };
            match call() {
                Err(error) if Interrupt::takes(py, &error) => {
                    self.interrupt.raise(error);
                    Ok(vec![Command::Land])
                }
                called => called.map_err(|error| traceback(py, &error)),
            }
        });
        match called {
            Ok(commands) => self.carry_out(commands, context),
            // The host restarts the agent. No panic hook is called: the report has the traceback.
            Err(traceback) => resume_unwind(Box::new(traceback)),
        }
    }

    fn carry_out(&mut self, commands: Vec<Command>, context: &mut agent::Context<'_>) {
        for command in commands {
            match command {
                Command::GoTo(to) => context.go_to(to),
                Command::Track(at, velocity) => context.track(at, velocity),
                Command::Hold => context.hold(),
                Command::Leave => context.leave(),
                Command::Land => context.land(),
                Command::Send {
                    token,
                    to,
                    payload,
                    reliability,
                } => {
                    self.next_token = token.wrapping_add(1);
                    let is_acknowledged =
                        reliability == Reliability::Acknowledged && to != Destination::All;
                    let id = context
                        .send(to, &payload, reliability)
                        .expect("its length and number were checked when it was asked for");
                    self.tokens.insert(id, token, is_acknowledged);
                }
                Command::SetTimer(timer, after) => context.set_timer(timer, after),
                Command::CancelTimer(timer) => context.cancel_timer(timer),
                Command::SetTelemetry(period) => context.set_telemetry(period),
                Command::Keep(kept) => context
                    .keep(&kept)
                    .expect("its length was checked when it was asked for"),
                Command::Observe(name, value) => context.observe(&name, value),
            }
        }
    }
}

/// Refuses an object without any method of an agent.
fn check(object: &Bound<'_, PyAny>, id: NodeId) -> PyResult<()> {
    for method in METHODS {
        if object.hasattr(method)? {
            return Ok(());
        }
    }
    let (id, kind, methods) = (id.0, object.get_type().name()?, METHODS.join(", "));
    Err(PyTypeError::new_err(format!(
        "`new({id})` returned a {kind}, which is no agent: it has none of the methods {methods}"
    )))
}

/// A seed from the drone's random generator.
fn muster_seed(context: &mut agent::Context<'_>) -> u64 {
    context.rng().random()
}

/// The traceback of an exception and of its causes, as Python prints them.
fn traceback(py: Python<'_>, error: &PyErr) -> String {
    let print = || -> PyResult<String> {
        let module = py.import("traceback")?;
        let raised = (error.get_type(py), error.value(py), error.traceback(py));
        let lines = module.call_method1("format_exception", raised)?;
        Ok(lines.extract::<Vec<String>>()?.concat())
    };
    let printed = print().unwrap_or_else(|_| error.to_string());
    printed.trim_end().to_owned()
}

impl Agent for PyAgent {
    fn start(&mut self, context: &mut agent::Context<'_>) {
        self.call(context, "start", |_| Ok(Vec::new()));
    }

    fn telemetry(&mut self, telemetry: &agent::Telemetry, context: &mut agent::Context<'_>) {
        let velocity = muster::Ned(telemetry.velocity.0);
        let telemetry = Telemetry {
            position: place(telemetry.position),
            velocity: place(velocity),
            has_arrived: telemetry.has_arrived,
        };
        self.call(context, "telemetry", |py| {
            Ok(vec![Bound::new(py, telemetry)?.into_any()])
        });
    }

    fn message(&mut self, from: NodeId, payload: &[u8], context: &mut agent::Context<'_>) {
        self.call(context, "message", |py| {
            let from = from.0.into_pyobject(py)?.into_any();
            Ok(vec![from, PyBytes::new(py, payload).into_any()])
        });
    }

    fn timer(&mut self, timer: TimerId, context: &mut agent::Context<'_>) {
        self.call(context, "timer", |py| {
            Ok(vec![timer.0.into_pyobject(py)?.into_any()])
        });
    }

    fn swarm(&mut self, event: agent::SwarmEvent, context: &mut agent::Context<'_>) {
        use agent::SwarmEvent as Is;
        let ids = |set: &muster::NodeSet| set.iter().map(|id| id.0).collect();
        let reason = match &event {
            Is::MessageSent {
                outcome: Outcome::Dropped(reason),
                ..
            } => Some(reason.to_string()),
            _ => None,
        };
        let (kind, drones, message) = match &event {
            Is::LeaderChanged(leader) => ("leader_changed", vec![leader.0], None),
            Is::LeaderSilent => ("leader_silent", Vec::new(), None),
            Is::LeaderReturned => ("leader_returned", Vec::new(), None),
            Is::MembersLost(lost) => ("members_lost", ids(lost), None),
            Is::MembersJoined(joined) => ("members_joined", ids(joined), None),
            Is::MessageSent { id, outcome } => {
                let kind = match outcome {
                    Outcome::Delivered => "message_delivered",
                    Outcome::Expired => "message_expired",
                    Outcome::Dropped(_) => "message_dropped",
                };
                (kind, Vec::new(), self.tokens.remove(*id))
            }
        };
        let event = SwarmEvent {
            kind,
            drones,
            message,
            reason,
        };
        self.call(context, "swarm", |py| {
            Ok(vec![Bound::new(py, event)?.into_any()])
        });
    }
}
