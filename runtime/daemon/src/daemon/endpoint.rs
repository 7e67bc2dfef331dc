//! The HTTP endpoint of `observe.http`: metrics, health and status of a drone, on the drone's one thread.
//!
//! Clients can't delay the drone: the number of connections is limited, a connection takes one request and ends after a
//! timeout, and bodies of requests are not read.

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

/// The most open connections; others wait in the system's backlog.
const CONNECTIONS_MAX: usize = 8;
/// The longest time for a request and its response.
const CONNECTION_TIMEOUT: Duration = Duration::from_secs(3);

const OPEN_METRICS: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// Pause before a drone in flight tries again to open the address.
const RETRY_PERIOD: Duration = Duration::from_secs(1);

/// The endpoint's address and, once open, its listener.
pub(super) struct Endpoint {
    address: SocketAddr,
    listener: Option<TcpListener>,
}

impl Endpoint {
    /// An endpoint that is not open yet.
    pub(super) const fn at(address: SocketAddr) -> Self {
        Self {
            address,
            listener: None,
        }
    }

    /// Opens the address. Requests are answered from [`Self::serve`] on.
    ///
    /// # Errors
    /// If the address can't be opened.
    pub(super) async fn open(&mut self) -> io::Result<()> {
        self.listener = Some(TcpListener::bind(self.address).await?);
        Ok(())
    }

    /// Returns the listener, after retries if the address could not be opened.
    async fn listener(mut self) -> LimitedListener {
        let mut is_late = false;
        let listener = loop {
            match self.listener.take() {
                Some(listener) => break listener,
                None => {
                    is_late = true;
                    sleep(RETRY_PERIOD).await;
                    // The first failure was logged.
                    let _ = self.open().await;
                }
            }
        };
        if is_late {
            tracing::info!("listens at {}", self.address);
        }
        LimitedListener {
            listener,
            permits: Arc::new(Semaphore::new(CONNECTIONS_MAX)),
        }
    }

    /// Answers requests until the runtime ends.
    pub(super) async fn serve(self, process: Arc<Process>) {
        let router = Router::new()
            .route("/metrics", get(metrics))
            .route("/health", get(health))
            .route("/status", get(status))
            .with_state(process)
            .layer(axum::middleware::map_response(close_connection));
        // Never returns: a failed connection does not end it.
        let _ = axum::serve(self.listener().await, router).await;
    }
}

/// Accepts connections while fewer than the limit are open.
struct LimitedListener {
    listener: TcpListener,
    permits: Arc<Semaphore>,
}

/// Closes the connection after one response.
async fn close_connection(mut response: Response) -> Response {
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
        return (StatusCode::OK, "healthy\n".to_owned());
    }
    let lines = faults.iter().map(|fault| format!("{fault}\n"));
    (StatusCode::SERVICE_UNAVAILABLE, lines.collect())
}

async fn status(State(process): State<Arc<Process>>) -> Response {
    Json(process.status()).into_response()
}

impl Listener for LimitedListener {
    type Io = TimedConnection;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (TimedConnection, SocketAddr) {
        let permit = Arc::clone(&self.permits).acquire_owned().await;
        let permit = permit.expect("the semaphore is never closed");
        let (stream, address) = Listener::accept(&mut self.listener).await;
        let connection = TimedConnection {
            stream,
            timeout: Box::pin(sleep(CONNECTION_TIMEOUT)),
            _permit: permit,
        };
        (connection, address)
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }
}

/// A connection with a timeout.
pub(super) struct TimedConnection {
    stream: TcpStream,
    timeout: Pin<Box<Sleep>>,
    /// Admits another connection when dropped.
    _permit: OwnedSemaphorePermit,
}

impl TimedConnection {
    /// The stream, or an error after the timeout. The calling task is woken at the timeout.
    fn stream(&mut self, context: &mut Context<'_>) -> io::Result<Pin<&mut TcpStream>> {
        match self.timeout.as_mut().poll(context) {
            Poll::Ready(()) => Err(io::ErrorKind::TimedOut.into()),
            Poll::Pending => Ok(Pin::new(&mut self.stream)),
        }
    }
}

impl AsyncRead for TimedConnection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        self.stream(context)?.poll_read(context, buffer)
    }
}

impl AsyncWrite for TimedConnection {
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
