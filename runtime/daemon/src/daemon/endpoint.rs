//! Where a drone's process is asked what it is doing: metrics, health and status over HTTP, on the drone's one thread.
//!
//! Whoever asks holds up nothing: only so many are let in at once, each for so long and for one question, and nothing of
//! what they send is read but its head.

use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use axum::extract::State;
use axum::http::header::{CONNECTION, CONTENT_TYPE};
use axum::http::{HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::serve::Listener;
use axum::{Json, Router};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{Sleep, sleep};

use super::metrics;
use super::process::Process;

/// How many are let in at once; others wait with the system.
const VISITORS_MAX: usize = 8;
/// How long each may take, question and answer together.
const VISIT_MAX: Duration = Duration::from_secs(3);

const OPEN_METRICS: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// How often a drone in flight tries to have an address that it can't have.
const TRY_EVERY: Duration = Duration::from_secs(1);

/// Where questions come in.
pub(super) struct Endpoint {
    address: SocketAddr,
    listener: Option<TcpListener>,
}

impl Endpoint {
    /// One at an address of this machine's, at which nobody listens yet.
    pub(super) const fn at(address: SocketAddr) -> Self {
        Self {
            address,
            listener: None,
        }
    }

    /// Listens there. Questions are answered from [`Self::answer`] on.
    ///
    /// # Errors
    /// When the address can't be had.
    pub(super) async fn open(&mut self) -> io::Result<()> {
        self.listener = Some(TcpListener::bind(self.address).await?);
        Ok(())
    }

    /// Listens there as soon as that can be had.
    async fn opened(mut self) -> Door {
        let mut is_late = false;
        let listener = loop {
            match self.listener.take() {
                Some(listener) => break listener,
                None => {
                    is_late = true;
                    sleep(TRY_EVERY).await;
                    // Why it can't be had was told when that was found.
                    let _ = self.open().await;
                }
            }
        };
        if is_late {
            tracing::info!("can be asked at {} from now on", self.address);
        }
        Door {
            listener,
            room: Arc::new(Semaphore::new(VISITORS_MAX)),
        }
    }

    /// Answers whoever asks, for as long as the runtime lives.
    pub(super) async fn answer(self, process: Arc<Process>) {
        let router = Router::new()
            .route("/metrics", get(metrics))
            .route("/health", get(health))
            .route("/status", get(status))
            .with_state(process)
            .layer(axum::middleware::map_response(last_of_a_connection));
        // It goes on whatever happens to a connection.
        let _ = axum::serve(self.opened().await, router).await;
    }
}

/// Lets those in who ask.
struct Door {
    listener: TcpListener,
    room: Arc<Semaphore>,
}

/// One question a connection: whoever has asked makes room.
async fn last_of_a_connection(mut response: Response) -> Response {
    let close = HeaderValue::from_static("close");
    response.headers_mut().insert(CONNECTION, close);
    response
}

async fn metrics(State(process): State<Arc<Process>>) -> Response {
    match metrics::page(process.status()) {
        Ok(page) => ([(CONTENT_TYPE, OPEN_METRICS)], page).into_response(),
        Err(_) => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
    }
}

async fn health(State(process): State<Arc<Process>>) -> (StatusCode, String) {
    let faults = process.state().faults(process.clock.now());
    if faults.is_empty() {
        return (StatusCode::OK, "well\n".to_owned());
    }
    let lines = faults.iter().map(|fault| format!("{fault}\n"));
    (StatusCode::SERVICE_UNAVAILABLE, lines.collect())
}

async fn status(State(process): State<Arc<Process>>) -> Response {
    Json(process.status()).into_response()
}

impl Listener for Door {
    type Io = Visit;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Visit, SocketAddr) {
        let place = Arc::clone(&self.room).acquire_owned().await;
        let place = place.expect("the semaphore is never closed");
        let (stream, address) = Listener::accept(&mut self.listener).await;
        let visit = Visit {
            stream,
            end: Box::pin(sleep(VISIT_MAX)),
            _place: place,
        };
        (visit, address)
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }
}

/// A connection that ends in time, whatever the other end does.
pub(super) struct Visit {
    stream: TcpStream,
    end: Pin<Box<Sleep>>,
    _place: OwnedSemaphorePermit,
}

impl Visit {
    /// The stream, unless the visit is over; whoever waits for it is woken then.
    fn stream(&mut self, context: &mut Context<'_>) -> io::Result<Pin<&mut TcpStream>> {
        match self.end.as_mut().poll(context) {
            Poll::Ready(()) => Err(io::ErrorKind::TimedOut.into()),
            Poll::Pending => Ok(Pin::new(&mut self.stream)),
        }
    }
}

impl AsyncRead for Visit {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        self.stream(context)?.poll_read(context, buffer)
    }
}

impl AsyncWrite for Visit {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        self.stream(context)?.poll_write(context, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        self.stream(context)?.poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        self.stream(context)?.poll_shutdown(context)
    }
}
