//! State of the device or the recording, and errors, as lines.

use anyhow::Result;
use foxglove::messages::Log;
use foxglove::messages::log::Level;

use super::Message;
use crate::foxglove::topics::Topic;
use crate::hub::{Connection, Snapshot};
use dtof_data::options::rows::printable;
use dtof_run::export::foxglove::{Time, encoded};

/// Writes lines when a state changes.
#[derive(Default)]
pub struct StatusLog {
    /// Why there are no points, if there are none.
    pub no_points: Option<String>,
    /// The last lines on source, sensor, recording and points.
    last: [Option<(Level, String)>; 4],
}

impl StatusLog {
    /// Writes the lines that have changed, or all with `resend`.
    ///
    /// # Errors
    /// Fails if a message cannot be encoded.
    pub fn write(
        &mut self,
        snapshot: &Snapshot,
        time: u64,
        resend: bool,
        messages: &mut Vec<Message>,
    ) -> Result<()> {
        let Connection { state, reason, .. } = &snapshot.connection;
        let level = match *state {
            "gone" | "stopped" | "failed" => Level::Error,
            _ => Level::Info,
        };
        let source = match &reason[..] {
            "" => (*state).to_owned(),
            reason => format!("{state}: {reason}"),
        };
        let fault = snapshot.losses.last_fault.as_ref();
        let recording = &snapshot.recording_error;
        let lines = [
            Some((level, source)),
            fault.map(|fault| (Level::Warning, format!("sensor: {fault}"))),
            (!recording.is_empty()).then(|| (Level::Error, format!("recording: {recording}"))),
            self.no_points.clone().map(|line| (Level::Error, line)),
        ];
        let changed = lines.iter().zip(&self.last);
        let changed = changed.filter(|(line, last)| resend || line != last);
        for (level, line) in changed.filter_map(|(line, _)| line.as_ref()) {
            let log = Log {
                timestamp: Time::from_nanoseconds(time).stamp(),
                level: (*level).into(),
                message: printable(line),
                name: snapshot.name.clone(),
                ..Log::default()
            };
            messages.push(Message {
                topic: Topic::Log,
                time,
                data: encoded(&log)?,
            });
        }
        self.last = lines;
        Ok(())
    }
}
