//! How a drone's datagrams move.
