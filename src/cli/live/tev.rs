//! The render in tev: an image that is made once and updated, by tev's own protocol over TCP. A viewer that is gone or
//! does not read is left behind.

use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

use tev_client::{PacketCreateImage, PacketUpdateImage, TevClient};

use super::frame::Frame;
use crate::error::{Error, Result};

/// Longest wait for a connection, and for one write.
const PATIENCE: Duration = Duration::from_secs(2);

/// Shortest time between two updates.
const INTERVAL: Duration = Duration::from_millis(250);

const CHANNELS: [&str; 3] = ["R", "G", "B"];

/// A connection to tev.
pub struct Tev {
    client: TevClient,
    name: String,
    size: Option<(u32, u32)>,
    last: Option<Instant>,
}

impl Tev {
    /// Connects; the image will be called `name`.
    ///
    /// # Errors
    /// [`Error::Io`] naming the address.
    pub fn connect(address: &str, name: &str) -> Result<Self> {
        let failed = |source| Error::io(address, "reach tev at", source);
        let nowhere = || std::io::Error::other("no such host; write HOST:PORT, as in 127.0.0.1:14158");
        let at = address.to_socket_addrs().map_err(failed)?.next().ok_or_else(nowhere).map_err(failed)?;
        let stream = TcpStream::connect_timeout(&at, PATIENCE).map_err(failed)?;
        stream.set_write_timeout(Some(PATIENCE)).map_err(failed)?;
        Ok(Tev { client: TevClient::wrap(stream), name: name.into(), size: None, last: None })
    }

    /// Whether an update is due.
    pub fn is_due(&self) -> bool {
        self.last.is_none_or(|last| last.elapsed() >= INTERVAL)
    }

    /// Shows a frame.
    ///
    /// # Errors
    /// Those of the connection.
    pub fn show(&mut self, frame: &Frame) -> std::io::Result<()> {
        let (width, height) = frame.size;
        if self.size != Some(frame.size) {
            self.client.send(PacketCreateImage {
                image_name: &self.name,
                grab_focus: self.size.is_none(),
                width,
                height,
                channel_names: &CHANNELS,
            })?;
            self.size = Some(frame.size);
        }
        let data: Vec<f32> = frame.pixels.chunks_exact(4).flat_map(|pixel| &pixel[..3]).copied().collect();
        self.client.send(PacketUpdateImage {
            image_name: &self.name,
            grab_focus: false,
            channel_names: &CHANNELS,
            channel_offsets: &[0, 1, 2],
            channel_strides: &[3, 3, 3],
            x: 0,
            y: 0,
            width,
            height,
            data: &data,
        })?;
        self.last = Some(Instant::now());
        Ok(())
    }
}
