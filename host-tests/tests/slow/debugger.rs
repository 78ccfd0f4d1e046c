//! A debugger client for QEMU, by GDB's remote protocol: reads memory and registers, runs and stops.
//! It needs no code in the image.

use std::io::{BufReader, Read, Write};
use std::net::{Ipv4Addr, TcpStream};
use std::ops::Range;
use std::time::Duration;

use anyhow::{Context, Result, bail, ensure};

/// Bytes per answer; QEMU allows 2048.
const PIECE: u64 = 1024;

/// A processor under control.
pub struct Debugger(BufReader<TcpStream>);

impl Debugger {
    /// Connects, which stops a running processor. `patience` is the longest wait for an answer.
    pub fn connect(port: u16, patience: Duration) -> std::io::Result<Self> {
        let stream = TcpStream::connect((Ipv4Addr::LOCALHOST, port))?;
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(patience))?;
        Ok(Self(BufReader::new(stream)))
    }

    /// Lets the processor run.
    pub fn resume(&mut self) -> Result<()> {
        self.send("c")
    }

    /// Stops the processor while it runs.
    pub fn interrupt(&mut self) -> Result<()> {
        self.0.get_mut().write_all(&[3])?;
        self.wait_for_stop()
    }

    /// Sets or removes a breakpoint at `address`.
    pub fn set_breakpoint(&mut self, address: u64, on: bool) -> Result<()> {
        let letter = if on { 'Z' } else { 'z' };
        self.send(&format!("{letter}0,{address:x},2"))?;
        let reply = self.reply()?;
        ensure!(reply == "OK", "the debugger answers `{reply}`");
        Ok(())
    }

    /// Runs one instruction.
    pub fn step(&mut self) -> Result<()> {
        self.send("s")?;
        self.wait_for_stop()
    }

    /// Waits until the processor stops.
    pub fn wait_for_stop(&mut self) -> Result<()> {
        let packet = self.receive()?;
        ensure!(is_stop(&packet), "the debugger answers `{packet}`");
        Ok(())
    }

    /// The core registers: 0 to 12, 13 the stack pointer, 15 the next instruction.
    pub fn registers(&mut self) -> Result<[u32; 16]> {
        self.send("g")?;
        let bytes = bytes(&self.reply()?)?;
        let (words, _) = bytes.as_chunks();
        let words = words.get(..16).context("not all registers")?;
        let words: Vec<u32> = words.iter().map(|word| u32::from_le_bytes(*word)).collect();
        words.try_into().ok().context("not 16 registers")
    }

    /// Sets core registers, by their numbers.
    pub fn set_registers(&mut self, values: &[(usize, u32)]) -> Result<()> {
        self.send("g")?;
        let mut digits = self.reply()?;
        for &(register, value) in values {
            let value = format!("{:08x}", value.swap_bytes());
            digits.replace_range(8 * register..8 * register + 8, &value);
        }
        self.send(&format!("G{digits}"))?;
        let reply = self.reply()?;
        ensure!(reply == "OK", "the debugger answers `{reply}`");
        Ok(())
    }

    /// Writes a word.
    pub fn write(&mut self, address: u64, word: u32) -> Result<()> {
        self.send(&format!("M{address:x},4:{:08x}", word.swap_bytes()))?;
        let reply = self.reply()?;
        ensure!(reply == "OK", "the debugger answers `{reply}`");
        Ok(())
    }

    /// Reads memory.
    pub fn memory(&mut self, addresses: Range<u64>) -> Result<Vec<u8>> {
        let mut memory = Vec::new();
        let mut address = addresses.start;
        while address < addresses.end {
            let length = PIECE.min(addresses.end - address);
            self.send(&format!("m{address:x},{length:x}"))?;
            let piece = bytes(&self.reply()?)?;
            ensure!(
                piece.len() as u64 == length,
                "could not read all memory at {address:#x}"
            );
            memory.extend(piece);
            address += length;
        }
        Ok(memory)
    }

    /// The answer to the last command. Some versions of QEMU first report that the processor stopped
    /// when the debugger connected.
    fn reply(&mut self) -> Result<String> {
        loop {
            let packet = self.receive()?;
            if !is_stop(&packet) {
                return Ok(packet);
            }
        }
    }

    fn send(&mut self, content: &str) -> Result<()> {
        let packet = format!("${content}#{:02x}", checksum(content.as_bytes()));
        self.0.get_mut().write_all(packet.as_bytes())?;
        Ok(())
    }

    /// The next packet. Checksums are ignored, as TCP damages none.
    fn receive(&mut self) -> Result<String> {
        while self.byte()? != b'$' {}
        let mut content = Vec::new();
        loop {
            match self.byte()? {
                b'#' => break,
                // QEMU uses no run lengths, and these answers need no escapes.
                byte @ (b'*' | b'}') => bail!("the debugger sends {byte:#04x}"),
                byte => content.push(byte),
            }
        }
        let _checksum = [self.byte()?, self.byte()?];
        self.0.get_mut().write_all(b"+")?;
        Ok(String::from_utf8(content)?)
    }

    fn byte(&mut self) -> Result<u8> {
        let mut byte = [0];
        self.0
            .read_exact(&mut byte)
            .context("no answer from QEMU's debugger")?;
        Ok(byte[0])
    }
}

/// Whether a packet reports that the processor has stopped.
fn is_stop(packet: &str) -> bool {
    packet.starts_with(['T', 'S'])
}

fn checksum(content: &[u8]) -> u8 {
    content.iter().fold(0, |sum, byte| sum.wrapping_add(*byte))
}

/// Parses hexadecimal digits.
fn bytes(digits: &str) -> Result<Vec<u8>> {
    let (pairs, rest) = digits.as_bytes().as_chunks::<2>();
    let byte = |pair: &[u8; 2]| u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok();
    let bytes: Option<Vec<u8>> = pairs.iter().map(byte).collect();
    let bytes = bytes.filter(|_| rest.is_empty());
    bytes.with_context(|| format!("the debugger answers `{digits}`"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_hexadecimal_digits() {
        assert_eq!(bytes("00ff7a").unwrap(), [0, 255, 0x7a]);
        assert!(bytes("E22").unwrap_err().to_string().contains("E22"));
        assert!(bytes("").unwrap().is_empty());
    }

    #[test]
    fn adds_up_a_packet() {
        assert_eq!(checksum(b"OK"), 0x9a);
        assert_eq!(checksum(b"m20000000,400"), 0xaf);
    }
}
