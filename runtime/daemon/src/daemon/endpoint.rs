//! The HTTP endpoint of `observe.http`: metrics, health and status of a drone, on the drone's one thread.
//!
//! Clients can't delay the drone: the number of connections is limited, a connection takes one request and ends after a
//! timeout, and bodies of requests are not read.

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Semaphore;
use tokio::time::{sleep, timeout};

use super::http::{self, Page, Parsed, REQUEST_MAX, Status};
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
    async fn listener(mut self) -> TcpListener {
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
        listener
    }

    /// Answers requests until the runtime ends.
    pub(super) async fn serve(self, process: Arc<Process>) {
        let listener = self.listener().await;
        let permits = Arc::new(Semaphore::new(CONNECTIONS_MAX));
        loop {
            let permit = Arc::clone(&permits).acquire_owned().await;
            let permit = permit.expect("the semaphore is never closed");
            let Ok((stream, _)) = listener.accept().await else {
                // The process has too many open files, or the client is gone.
                sleep(RETRY_PERIOD).await;
                continue;
            };
            let process = Arc::clone(&process);
            tokio::spawn(async move {
                // A client that is slow or goes away fails for itself.
                let _ = timeout(CONNECTION_TIMEOUT, answer(stream, &process)).await;
                drop(permit);
            });
        }
    }
}

/// Answers one request.
async fn answer(mut stream: TcpStream, process: &Process) -> io::Result<()> {
    let mut received = Vec::new();
    let response = loop {
        match http::parse(&received) {
            Parsed::Request(request) => break request.response(page(process, &request.path)),
            Parsed::Invalid => break Page::empty(Status::BAD_REQUEST).response(),
            Parsed::Incomplete if received.len() >= REQUEST_MAX => {
                break Page::empty(Status::TOO_LARGE).response();
            }
            Parsed::Incomplete => {}
        }
        if stream.read_buf(&mut received).await? == 0 {
            return Ok(());
        }
    };
    stream.write_all(&response).await?;
    stream.shutdown().await
}

/// The page with this path; `None` if there is none.
fn page(process: &Process, path: &str) -> Option<Page> {
    let page = match path {
        "/metrics" => match metrics::page(process.status()) {
            Ok(text) => Page {
                status: Status::OK,
                content_type: OPEN_METRICS,
                body: text.into_bytes(),
            },
            Err(_) => Page::empty(Status::INTERNAL_ERROR),
        },
        "/status" => match serde_json::to_vec(&process.status()) {
            Ok(body) => Page {
                status: Status::OK,
                content_type: "application/json",
                body,
            },
            Err(_) => Page::empty(Status::INTERNAL_ERROR),
        },
        "/health" => health(process),
        _ => return None,
    };
    Some(page)
}

fn health(process: &Process) -> Page {
    let faults = process.state().faults(process.clock.now());
    let (status, text) = if faults.is_empty() {
        (Status::OK, "healthy\n".to_owned())
    } else {
        let lines = faults.iter().map(|fault| format!("{fault}\n"));
        (Status::UNAVAILABLE, lines.collect())
    };
    Page {
        body: text.into_bytes(),
        ..Page::empty(status)
    }
}
