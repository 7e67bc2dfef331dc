//! Time between RC frames at a receiver on TCP, while every core is busy: `gaps SECONDS`. Prints n, p50, p99 and the longest.

use std::error::Error;
use std::io::Read;
use std::net::TcpListener;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::thread;
use std::time::{Duration, Instant};

use muster_msp::{Channel, Decoder, Message, SetRawRc, Sticks};
use muster_port::Link;

static DONE: AtomicBool = AtomicBool::new(false);

#[expect(clippy::print_stdout, reason = "its result")]
fn main() -> Result<(), Box<dyn Error>> {
    let seconds = std::env::args()
        .nth(1)
        .ok_or("usage: gaps SECONDS")?
        .parse()?;
    let listener = TcpListener::bind("127.0.0.1:0")?;
    let link = Link::start(format!("tcp:{}", listener.local_addr()?).parse()?, None)?;
    let (arrived, arrivals) = mpsc::channel();
    let mut stream = listener.accept()?.0;
    thread::spawn(move || {
        // As punctual as the writer, so that its own delays don't count.
        let priority = thread_priority::ThreadPriority::Max;
        let _ = thread_priority::set_current_thread_priority(priority);
        let mut decoder = Decoder::default();
        let mut buffer = [0; 256];
        while let Ok(length @ 1..) = stream.read(&mut buffer) {
            let now = Instant::now();
            decoder.read(&buffer[..length], |frame| {
                if frame.command == SetRawRc::COMMAND {
                    // The other end is gone when the example ends.
                    let _ = arrived.send(now);
                }
            });
        }
    });
    for _ in 0..thread::available_parallelism()?.get() {
        thread::spawn(|| {
            while !DONE.load(Ordering::Relaxed) {
                std::hint::spin_loop();
            }
        });
    }
    let channels = SetRawRc::new(Sticks::IDLE, &[Channel::LOW; 4])?;
    let started = Instant::now();
    while started.elapsed() < Duration::from_secs(seconds) {
        link.set_channels(channels);
        thread::sleep(Duration::from_millis(20));
    }
    let status = link.status();
    DONE.store(true, Ordering::Relaxed);
    drop(link);
    let times: Vec<Instant> = arrivals.iter().collect();
    let mut gaps: Vec<Duration> = times.windows(2).map(|it| it[1] - it[0]).collect();
    gaps.sort();
    let at = |share: f64| gaps[(share * (gaps.len() - 1) as f64) as usize];
    println!(
        "real time {}: {} gaps, p50 {:?}, p99 {:?}, max {:?}; as written max {:?}",
        status.is_realtime,
        gaps.len(),
        at(0.5),
        at(0.99),
        at(1.0),
        status.rc_gap_max
    );
    Ok(())
}
