//! A look in three steps, so that all pixels of an array decide before one of them clears its
//! histogram: [`crate::neighbours`].

use super::AsyncPixel;
use super::input::DecisionInput;
use super::look::{Look, State};
use crate::config::PixelConfig;
use crate::detect::{Detection, DetectionRule, Exposed, NeighbourRule};
use crate::histogram::counter::CounterWidth;
use crate::statistics::Statistics;
use crate::units::LaserCycle;

impl<const BINS: usize, W: CounterWidth> AsyncPixel<BINS, W> {
    /// The first step: ends `cycles` laser cycles. Returns whether this is a look that decides, after
    /// X laser cycles or more and past L1.
    #[inline]
    pub(crate) fn begin_look<R: DetectionRule>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        statistics: &mut Statistics,
        cycles: u16,
    ) -> bool {
        self.exposure = self.exposure.saturating_add(cycles);
        self.since_look = self.since_look.saturating_add(cycles);
        if self.since_look < config.x() {
            return false;
        }
        self.since_look = 0;
        if self.exposure <= config.l1() {
            return false;
        }
        if self.state.contains(State::HAS_ECHO) && !self.weighs_dead_time(config) {
            self.leave_out_excluded::<R, false>(config, statistics);
        }
        self.state.set(State::DECIDES);
        true
    }

    /// The second step, once all neighbours have done the first: the detection, by the pixel's own photons or with
    /// those of its `neighbours`, at most 8. `config` must have the rule [`NeighbourRule::own`]. `None` if the first step was no look that decides, or the rule weighs a dead time.
    #[must_use]
    pub(crate) fn decide<'a, R: DetectionRule>(
        &'a self,
        config: &PixelConfig<BINS, R>,
        rule: &NeighbourRule,
        neighbours: impl Iterator<Item = &'a Self>,
    ) -> Option<Detection>
    where
        W: 'a,
    {
        let (decides, waits) = (State::DECIDES, State::REQUESTING);
        if !self.state.contains(decides)
            || self.state.contains(waits)
            || self.exposure >= self.longest(config)
            || self.weighs_dead_time(config)
            || self.is_full()
        {
            return None;
        }
        let (histogram, excluded) = (&self.histogram, &self.excluded);
        let alone = config.detect_further(histogram, self.expected(), excluded);
        alone.or_else(|| {
            let neighbours = neighbours.filter(|other| !other.is_full());
            let (gate, estimator) = (config.gate(), config.estimator());
            rule.confirm(
                self.exposed(),
                gate,
                estimator,
                neighbours.map(Self::exposed),
            )
        })
    }

    /// What the decision needs of it.
    #[inline(always)]
    const fn exposed(&self) -> Exposed<'_, BINS, W> {
        Exposed {
            histogram: &self.histogram,
            excluded: &self.excluded,
            cycles: self.exposure,
        }
    }

    /// Keeps what the second step gave in the slot, until the third. Does nothing where the second step gives
    /// nothing: an event that waits is not lost.
    #[inline]
    pub(crate) fn keep_detection(&mut self, cycle: LaserCycle, detection: &Detection) {
        let waits = self.state.contains(State::REQUESTING);
        if self.state.contains(State::DECIDES) && !waits {
            self.put(cycle, detection);
            self.state.set(State::DETECTED);
        }
    }

    /// The third step, once all neighbours have decided: reports, or does what else ends a look. Where the rule weighs
    /// a dead time, the pixel decides here, alone. `cycle` is the last laser cycle, `observe` is as in
    /// [`Self::end_laser_cycles_with`].
    pub(crate) fn end_look<R: DetectionRule>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        statistics: &mut Statistics,
        cycle: LaserCycle,
        observe: impl FnOnce(&DecisionInput<'_, BINS, W>),
    ) -> Look {
        if !self.state.contains(State::DECIDES) {
            return if self.since_look == 0 {
                Look::TooEarly
            } else {
                Look::NotDue
            };
        }
        let is_detected = self.state.contains(State::DETECTED);
        self.state.clear(State::DECIDES);
        self.state.clear(State::DETECTED);
        if self.weighs_dead_time(config) {
            return self.look_on::<R, true>(config, statistics, cycle, observe);
        }
        if is_detected {
            observe(&DecisionInput {
                histogram: &self.histogram,
                expected: self.expected(),
                excluded: self.excluded,
                cycles: self.exposure.into(),
            });
            return self.report_slot(config, statistics);
        }
        let longest = self.longest(config);
        self.undecided(config, statistics, longest)
            .unwrap_or(Look::NoPeak)
    }

    /// The length at which this exposure ends without another event: L2, or where the wait for the next echo is over.
    #[inline]
    #[must_use]
    pub(crate) fn longest<R: DetectionRule>(&self, config: &PixelConfig<BINS, R>) -> u16 {
        if self.state.contains(State::HAS_ECHO) {
            self.longest_after_echo(config)
        } else {
            config.l2()
        }
    }

    /// The laser cycles from now on at whose looks the pixel finds nothing, if no photon comes. Its last look found nothing and
    /// was not blind, or was too early. A dead time is weighed by the laser cycles, and so are neighbours, if
    /// `asks_neighbours`: then a later look may find something in the same photons, unless they are too few.
    #[inline(never)]
    #[must_use]
    pub fn dark_cycles<R: DetectionRule>(
        &self,
        config: &PixelConfig<BINS, R>,
        asks_neighbours: bool,
    ) -> u16 {
        let (photons, weighs) = (self.histogram.total(), self.weighs_dead_time(config));
        let finds_none = if self.exposure <= config.l1() {
            photons == 0 && !weighs && !self.has_event()
        } else if weighs {
            photons < config.fewest_photons()
        } else {
            // A pixel asks for two in a window.
            photons < 2 || !asks_neighbours
        };
        let last = match finds_none {
            true => self.longest(config).saturating_sub(1).max(config.l1()),
            false => config.l1(),
        };
        last.saturating_sub(self.exposure)
    }
}
