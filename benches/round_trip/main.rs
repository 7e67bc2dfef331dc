//! What the way through radio and routing costs: `cargo bench --bench round_trip`. A payload goes from one drone to
//! another and back, over UDP on the loopback interface: signed, checked, taken in by the routing, answered. Beside it the
//! same number of bytes over two bare sockets of tokio, what signing and checking cost by themselves, and what it costs to
//! hand as many messages to actors that do nothing; all on one thread, in one run.

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

/// Round trips before any is measured: links are as they stay by then.
const WARM_UP: u32 = 1_000;
/// Round trips that are measured.
const MEASURED: u32 = 20_000;
/// So many round trips of one kind are measured in a row, so that what else the machine does befalls all kinds.
const IN_A_ROW: u32 = 500;

fn main() -> Result<(), Box<dyn Error>> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    let folder = tempfile::tempdir()?;
    let [mut near, far] = runtime.block_on(End::pair(folder.path()))?;
    runtime.block_on(measure(&mut near, &far))?;
    let allocated = allocation_counter::measure(|| {
        runtime.block_on(async {
            for _ in 0..IN_A_ROW {
                near.round_trip().await;
            }
        });
    });
    let frames = 2.0 * f64::from(IN_A_ROW);
    println!(
        "Allocations a frame, from what its sender says to what its receiver's routing has made of it: {:.2}, of {:.0} \
         bytes together.",
        figure(allocated.count_total) / frames,
        figure(allocated.bytes_total) / frames
    );
    runtime.block_on(async {
        near.stop().await;
        far.stop().await;
    });
    Ok(())
}

#[expect(clippy::cast_precision_loss, reason = "there are not that many")]
const fn figure(count: u64) -> f64 {
    count as f64
}

async fn measure(near: &mut End, far: &End) -> Result<(), Box<dyn Error>> {
    let bare = Bare::open().await?;
    let mailboxes = Mailboxes::open().await?;
    for _ in 0..WARM_UP {
        near.round_trip().await;
        mailboxes.round_trip().await;
        bare.round_trip().await?;
    }
    let (mut ours, mut theirs, mut handing) = (vec![], vec![], vec![]);
    let (mut signing, mut checking) = (vec![], vec![]);
    let covered = [7; FRAME_LEN];
    for _ in 0..MEASURED / IN_A_ROW {
        for _ in 0..IN_A_ROW {
            ours.push(timed(near.round_trip()).await);
        }
        for _ in 0..IN_A_ROW {
            theirs.push(timed(bare.round_trip()).await);
        }
        for _ in 0..IN_A_ROW {
            handing.push(timed(mailboxes.round_trip()).await);
        }
        for _ in 0..IN_A_ROW {
            let began = Instant::now();
            let signature = near.authenticator.sign(&covered);
            let signed = Instant::now();
            let is_right = far.authenticator.verify(near.id, &covered, &signature);
            checking.push(signed.elapsed());
            signing.push(signed - began);
            assert!(is_right, "what one signs the other believes");
        }
    }
    let rows = [
        ("radio and routing, there and back", median_and_99th(ours)),
        ("bare tokio UDP, there and back", median_and_99th(theirs)),
        ("one signing", median_and_99th(signing)),
        ("one checking", median_and_99th(checking)),
        (
            "six mailboxes, one after the other",
            median_and_99th(handing),
        ),
    ];
    println!(
        "A payload of {PAYLOAD_LEN} bytes in a frame of {FRAME_LEN}, microseconds\n\n{:<36}{:>10}{:>10}",
        "", "median", "99th"
    );
    for (name, [median, most]) in rows {
        println!("{name:<36}{median:>10.1}{most:>10.1}");
    }
    let [ours, bare, signing, checking, mailboxes] = rows.map(|(_, [median, _])| median);
    let cryptography = 2.0 * (signing + checking);
    let bound = 2.5 * bare + cryptography;
    println!(
        "\n2.5 bare round trips, two signings and two checkings: {bound:.1}; the median above is {:.2} of that.\nBeside \
         signing and checking it takes {:.1}, of which the bare round trip and the mailboxes are {:.1}.",
        ours / bound,
        ours - cryptography,
        bare + mailboxes
    );
    Ok(())
}

/// How long something takes, in time of the wall.
async fn timed<T>(what: impl Future<Output = T>) -> Duration {
    let began = Instant::now();
    what.await;
    began.elapsed()
}

/// The median and the 99th percentile, in microseconds.
fn median_and_99th(mut times: Vec<Duration>) -> [f64; 2] {
    times.sort_unstable();
    [50, 99].map(|percent| times[(times.len() - 1) * percent / 100].as_secs_f64() * 1e6)
}

/// Two sockets, one of which sends back what comes.
struct Bare {
    near: UdpSocket,
    far: SocketAddr,
}

impl Bare {
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
