//! What the device or the recording does, and why, in lines.

use anyhow::Result;
use foxglove::messages::Log;
use foxglove::messages::log::Level;

use super::Message;
use crate::foxglove::topics::Topic;
use crate::hub::{Connection, Seen};
use dtof_export::foxglove::{Time, encoded};
use dtof_options::rows::printable;

/// What was told.
#[derive(Default)]
pub struct Told {
    connection: Option<Connection>,
    fault: Option<String>,
    recording: String,
    /// Why there are no points, if there are none, and whether it was told.
    pub no_points: Option<String>,
    told_no_points: Option<String>,
}

impl Told {
    /// Tells what is new; all of it if somebody is.
    ///
    /// # Errors
    /// If it cannot be encoded.
    pub fn tell(
        &mut self,
        seen: &Seen,
        time: u64,
        is_new: bool,
        messages: &mut Vec<Message>,
    ) -> Result<()> {
        let mut lines = Vec::new();
        let connection = &seen.connection;
        if is_new || self.connection.as_ref() != Some(connection) {
            let level = match connection.state {
                "gone" | "stopped" | "failed" => Level::Error,
                _ => Level::Info,
            };
            let mut line = connection.state.to_owned();
            if !connection.reason.is_empty() {
                line += &format!(": {}", connection.reason);
            }
            lines.push((level, line));
            self.connection = Some(connection.clone());
        }
        let fault = &seen.losses.last_fault;
        if is_new || self.fault != *fault {
            let line = fault.iter().map(|fault| format!("sensor: {fault}"));
            lines.extend(line.map(|line| (Level::Warning, line)));
            self.fault.clone_from(fault);
        }
        let recording = &seen.recording_error;
        if (is_new || self.recording != *recording) && !recording.is_empty() {
            lines.push((Level::Error, format!("recording: {recording}")));
        }
        self.recording.clone_from(recording);
        if is_new || self.told_no_points != self.no_points {
            let lines_of = self
                .no_points
                .iter()
                .map(|line| (Level::Error, line.clone()));
            lines.extend(lines_of);
            self.told_no_points.clone_from(&self.no_points);
        }
        for (level, line) in lines {
            let log = Log {
                timestamp: Time::of(time).stamp(),
                level: level.into(),
                message: printable(&line),
                name: seen.name.clone(),
                ..Log::default()
            };
            messages.push(Message {
                topic: Topic::Log,
                time,
                data: encoded(&log)?,
            });
        }
        Ok(())
    }
}
