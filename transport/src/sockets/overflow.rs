//! Datagrams that the Linux kernel dropped before they were read.

use std::net::UdpSocket;
use std::os::fd::AsRawFd;
use std::sync::Arc;

/// Number of datagrams dropped for full receive buffers of these sockets; `None` if the kernel does not report it.
pub(crate) fn kernel_drops(sockets: &[Arc<UdpSocket>]) -> Option<u64> {
    let tables = ["/proc/self/net/udp", "/proc/self/net/udp6"];
    let tables: Vec<_> = (tables.into_iter())
        .filter_map(|it| std::fs::read_to_string(it).ok())
        .collect();
    let drops = sockets.iter().map(|socket| {
        let link = std::fs::read_link(format!("/proc/self/fd/{}", socket.as_raw_fd())).ok()?;
        let inode = link.to_str()?.strip_prefix("socket:[")?.strip_suffix(']')?;
        tables.iter().find_map(|table| drops_in(table, inode))
    });
    drops.sum()
}

/// The drops of a socket in a table of `/proc`: the last column of the line with this inode in column 10.
fn drops_in(table: &str, inode: &str) -> Option<u64> {
    let mut lines = table.lines().skip(1);
    let line = lines.find(|line| line.split_whitespace().nth(9) == Some(inode))?;
    line.split_whitespace().next_back()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: &str = "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode ref pointer drops
  214: 0100007F:B7C1 00000000:0000 07 00000000:00000000 00:00000000 00000000     0        0 4711 2 0000000000000000 0
  981: 00000000:0044 00000000:0000 07 00000000:00000000 00:00000000 00000000     0        0 4712 2 0000000000000000 12
";

    #[test]
    fn drops_are_found_by_the_exact_inode() {
        assert_eq!(drops_in(TABLE, "4711"), Some(0));
        assert_eq!(drops_in(TABLE, "4712"), Some(12));
        assert_eq!(drops_in(TABLE, "471"), None);
    }
}
