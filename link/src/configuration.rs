//! How the host wants the pixels to operate.

/// Where the device takes its photons from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Source {
    /// From the link: photons messages.
    Link,
    /// From its sensor.
    Sensor,
}

/// How the pixels are to operate, not yet validated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Configuration {
    /// α in 1/256; of the paper's rule.
    pub alpha: u16,
    /// Photons a reported peak, or the window around it, holds at least.
    pub minimum_count: u16,
    /// Laser cycles between looks.
    pub x: u16,
    /// The exposure a decision must exceed.
    pub l1: u16,
    /// The exposure at which a pixel starts over.
    pub l2: u16,
    /// First bin that may hold the peak.
    pub gate_first: u16,
    /// Last bin that may hold the peak.
    pub gate_last: u16,
    /// Pixels, addresses 0 up.
    pub pixels: u16,
    /// Bin width in 1/65,536 ps.
    pub bin_width: u32,
    /// Range offset in 1/256 mm.
    pub offset: i32,
    /// 0: link, 1: sensor.
    pub source: u8,
    /// 0: the paper's rule, 1: a window.
    pub rule: u8,
    /// Bins in the window of the rule.
    pub window: u8,
    /// z in 1/4096; of the window's rule.
    pub z: u16,
    /// 0: centre of mass of three bins, 1: centred window.
    pub estimator: u8,
    /// Half the width of the centred window in 1/256 bin.
    pub half_width: u16,
    /// 0: depth events, 1: dynamic depth events.
    pub output: u8,
    /// What a mean depth is compared with, 0: that of the event before, 1: the one
    /// reported last; of dynamic depth.
    pub reference: u8,
    /// How far a mean depth has to move, in 1/256 mm; of dynamic depth.
    pub threshold: u32,
    /// 1: the TDC takes one photon a laser cycle, so that events say when it piles up;
    /// 0: any number.
    pub one_hit: u8,
}

impl Configuration {
    /// Bytes of the record.
    pub const BYTES: usize = 39;

    /// As it is sent.
    #[must_use]
    pub fn to_le_bytes(&self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        let fields = [
            self.alpha,
            self.minimum_count,
            self.x,
            self.l1,
            self.l2,
            self.gate_first,
            self.gate_last,
            self.pixels,
        ];
        let wide = self
            .bin_width
            .to_le_bytes()
            .into_iter()
            .chain(self.offset.to_le_bytes());
        let [z, z_high] = self.z.to_le_bytes();
        let [half_width, half_width_high] = self.half_width.to_le_bytes();
        let all = fields
            .into_iter()
            .flat_map(u16::to_le_bytes)
            .chain(wide)
            .chain([self.source, self.rule, self.window, z, z_high])
            .chain([self.estimator, half_width, half_width_high])
            .chain([self.output, self.reference])
            .chain(self.threshold.to_le_bytes())
            .chain([self.one_hit]);
        for (place, byte) in bytes.iter_mut().zip(all) {
            *place = byte;
        }
        bytes
    }

    /// As it was received, or `None` if it is not as long as the record.
    #[must_use]
    pub fn from_le_bytes(bytes: &[u8]) -> Option<Self> {
        let bytes: &[u8; Self::BYTES] = bytes.try_into().ok()?;
        let two = |at: usize| Some(u16::from_le_bytes(bytes.get(at..at + 2)?.try_into().ok()?));
        let four = |at: usize| bytes.get(at..at + 4)?.try_into().ok();
        Some(Self {
            alpha: two(0)?,
            minimum_count: two(2)?,
            x: two(4)?,
            l1: two(6)?,
            l2: two(8)?,
            gate_first: two(10)?,
            gate_last: two(12)?,
            pixels: two(14)?,
            bin_width: u32::from_le_bytes(four(16)?),
            offset: i32::from_le_bytes(four(20)?),
            source: *bytes.get(24)?,
            rule: *bytes.get(25)?,
            window: *bytes.get(26)?,
            z: two(27)?,
            estimator: *bytes.get(29)?,
            half_width: two(30)?,
            output: *bytes.get(32)?,
            reference: *bytes.get(33)?,
            threshold: u32::from_le_bytes(four(34)?),
            one_hit: *bytes.get(38)?,
        })
    }
}
