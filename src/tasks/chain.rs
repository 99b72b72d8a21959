//! The chain line: sends the responder's packets, and passes on the packets that arrive.
//!
//! The line is half-duplex: the driver of a board switches the direction. Its `flush` must not return before the last
//! byte has left. The responder decides what is sent, and when: see [`crate::chain`].

use super::{Wires, micros, until};
use crate::protocol::{Decoder, frame};
use embassy_futures::select::{Either3, select3};
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant, Timer};
use embedded_io_async::{Read, Write};

/// Most bytes that one read takes from the receiver.
const CHUNK: usize = 64;

/// Pause after a line error. Without the pause a broken line would keep the processor busy.
const RECOVERY: Duration = Duration::from_millis(1);

/// Runs the chain line until `rx` reads 0 bytes. A serial line never reads 0 bytes.
///
/// The task drops the future of `rx.read` while it waits for bytes. Dropping the future must not lose bytes.
pub async fn run<M: RawMutex, const N: usize>(mut rx: impl Read, mut tx: impl Write, wires: &Wires<M, N>) {
    let mut decoder = Decoder::new();
    let mut chunk = [0; CHUNK];
    loop {
        let deadline = until(decoder.deadline());
        let length = match select3(rx.read(&mut chunk), wires.chain_send.receive(), deadline).await {
            Either3::First(Ok(0)) => return,
            Either3::First(Ok(length)) => length,
            Either3::First(Err(_)) => {
                wires.chain_bytes.signal(());
                Timer::after(RECOVERY).await;
                continue;
            }
            Either3::Second(packet) => {
                // A packet that cannot be sent is dropped. The host or the parent repeats its request.
                if tx.write_all(&frame::encode(&packet)).await.is_ok() {
                    let _ = tx.flush().await;
                }
                wires.chain_sent.signal(());
                continue;
            }
            Either3::Third(()) => 0,
        };
        let mut input = chunk.get(..length).unwrap_or_default();
        if length > 0 {
            wires.chain_bytes.signal(());
        }
        while let Some(packet) = decoder.next(&mut input, micros(Instant::now())) {
            wires.chain_bytes.reset();
            let _ = wires.chain_received.try_send(packet);
        }
        // A hub that sends without pauses must not keep other tasks from running.
        embassy_futures::yield_now().await;
    }
}
