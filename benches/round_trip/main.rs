//! Round-trip time through radio and routing: `cargo bench --bench round_trip`. A payload goes from one drone to another
//! and back over UDP on the loopback interface: signed, verified, processed by the routing and answered.
//!
//! For comparison: the same bytes over two plain tokio sockets, signing and verification alone, and the same number of
//! messages through empty actors. All on one thread, in one run.

#![expect(clippy::print_stdout, reason = "this is a program that prints a table")]

mod ends;
mod mailboxes;

use std::error::Error;
use std::future::Future;
use std::net::{Ipv4Addr, SocketAddr};
use std::time::{Duration, Instant};

use muster_machines::radio::Authenticator;
use tokio::net::UdpSocket;

use self::ends::{End, FRAME_LEN, PAYLOAD_LEN};
use self::mailboxes::Mailboxes;

/// Round trips before the measurement, so that the link tables are stable.
const WARM_UP: u32 = 1_000;
/// Measured round trips.
const MEASURED: u32 = 20_000;
/// Round trips of one kind in a row. The kinds alternate, so that other load on the machine affects all of them.
const BLOCK: u32 = 500;

fn main() -> Result<(), Box<dyn Error>> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    let folder = tempfile::tempdir()?;
    let [mut near, far] = runtime.block_on(End::pair(folder.path()))?;
    runtime.block_on(measure(&mut near, &far))?;
    let allocated = allocation_counter::measure(|| {
        runtime.block_on(async {
            for _ in 0..BLOCK {
                near.round_trip().await;
            }
        });
    });
    let frames = 2.0 * f64::from(BLOCK);
    println!(
        "Allocations per frame, from the sender's routing to the receiver's routing: {:.2}, of {:.0} bytes in total.",
        to_f64(allocated.count_total) / frames,
        to_f64(allocated.bytes_total) / frames
    );
    runtime.block_on(async {
        near.stop().await;
        far.stop().await;
    });
    Ok(())
}

#[expect(clippy::cast_precision_loss, reason = "the counts are far below 2^52")]
const fn to_f64(count: u64) -> f64 {
    count as f64
}

async fn measure(near: &mut End, far: &End) -> Result<(), Box<dyn Error>> {
    let bare = PlainSockets::open().await?;
    let mailboxes = Mailboxes::open().await?;
    for _ in 0..WARM_UP {
        near.round_trip().await;
        mailboxes.round_trip().await;
        bare.round_trip().await?;
    }
    let (mut ours, mut plain_times, mut mailbox_times) = (vec![], vec![], vec![]);
    let (mut signing, mut verifying) = (vec![], vec![]);
    let covered = [7; FRAME_LEN];
    for _ in 0..MEASURED / BLOCK {
        for _ in 0..BLOCK {
            ours.push(timed(near.round_trip()).await);
        }
        for _ in 0..BLOCK {
            plain_times.push(timed(bare.round_trip()).await);
        }
        for _ in 0..BLOCK {
            mailbox_times.push(timed(mailboxes.round_trip()).await);
        }
        for _ in 0..BLOCK {
            let started = Instant::now();
            let signature = near.authenticator.sign(&covered);
            let signed = Instant::now();
            let is_valid = far.authenticator.verify(near.id, &covered, &signature);
            verifying.push(signed.elapsed());
            signing.push(signed - started);
            assert!(is_valid, "the signature is valid");
        }
    }
    let rows = [
        ("radio and routing, round trip", median_and_99th(ours)),
        ("plain tokio UDP, round trip", median_and_99th(plain_times)),
        ("signing", median_and_99th(signing)),
        ("verification", median_and_99th(verifying)),
        ("six mailboxes in sequence", median_and_99th(mailbox_times)),
    ];
    println!(
        "A payload of {PAYLOAD_LEN} bytes in a frame of {FRAME_LEN}, microseconds\n\n{:<36}{:>10}{:>10}",
        "", "median", "99th"
    );
    for (name, [median, most]) in rows {
        println!("{name:<36}{median:>10.1}{most:>10.1}");
    }
    let [ours, bare, signing, verifying, mailboxes] = rows.map(|(_, [median, _])| median);
    let cryptography = 2.0 * (signing + verifying);
    let bound = 2.5 * bare + cryptography;
    println!(
        "\nBound (2.5 plain round trips, two signings, two verifications): {bound:.1}; the median is {:.2} of it.\nWithout \
         signing and verification: {:.1}, of which plain round trip and mailboxes take {:.1}.",
        ours / bound,
        ours - cryptography,
        bare + mailboxes
    );
    Ok(())
}

/// Wall-clock duration of a future.
async fn timed<T>(what: impl Future<Output = T>) -> Duration {
    let started = Instant::now();
    what.await;
    started.elapsed()
}

/// The median and the 99th percentile, in microseconds.
fn median_and_99th(mut times: Vec<Duration>) -> [f64; 2] {
    times.sort_unstable();
    [50, 99].map(|percent| times[(times.len() - 1) * percent / 100].as_secs_f64() * 1e6)
}

/// A plain socket, and another one that echoes.
struct PlainSockets {
    near: UdpSocket,
    far: SocketAddr,
}

impl PlainSockets {
    async fn open() -> Result<Self, Box<dyn Error>> {
        let near = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).await?;
        let far = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).await?;
        let address = far.local_addr()?;
        tokio::spawn(async move {
            let mut buffer = [0; 2 * FRAME_LEN];
            while let Ok((len, from)) = far.recv_from(&mut buffer).await {
                if far.send_to(&buffer[..len], from).await.is_err() {
                    return;
                }
            }
        });
        Ok(Self { near, far: address })
    }

    async fn round_trip(&self) -> Result<(), std::io::Error> {
        let mut buffer = [0; FRAME_LEN];
        self.near.send_to(&buffer, self.far).await?;
        self.near.recv_from(&mut buffer).await?;
        Ok(())
    }
}
