//! Comparison of verdicts with the truth, per pair and tick.

use crate::common::quantile;
use crate::stage::PAIRS;
use crate::table::{Row, percent_of};

#[derive(Default)]
pub struct Tally {
    /// Pairs without a verdict, summed over all ticks.
    pub unresolved: u64,
    pair_ticks: u64,
    apart: u64,
    unconfirmed: u64,
    false_alarms: u64,
    wrong: u64,
    guess_errors: u64,
    oldest: u64,
    onsets: u64,
    /// Contacts that ended before they were reported.
    missed: u64,
    delays: Vec<u64>,
    ages: Vec<u64>,
    last: Vec<bool>,
    begun: Vec<Option<u64>>,
    were: Vec<bool>,
}

impl Tally {
    pub fn new() -> Self {
        Self {
            ages: vec![0; PAIRS],
            last: vec![false; PAIRS],
            begun: vec![None; PAIRS],
            were: vec![true; PAIRS],
            ..Self::default()
        }
    }

    /// * `verdicts` - per pair: whether it collides; `None`: unresolved.
    pub fn compare(&mut self, tick: u64, truth: &[bool], verdicts: &[Option<bool>]) {
        for pair in 0..PAIRS {
            let (collides, verdict) = (truth[pair], verdicts[pair]);
            self.pair_ticks += 1;
            self.apart += u64::from(!collides);
            if collides && !self.were[pair] {
                self.begun[pair] = Some(tick);
                self.onsets += 1;
            }
            self.were[pair] = collides;
            match verdict {
                Some(said) => {
                    self.wrong += u64::from(said != collides);
                    self.ages[pair] = 0;
                    self.last[pair] = said;
                    if let Some(begun) = self.begun[pair].take_if(|_| said) {
                        self.delays.push(tick - begun);
                    }
                }
                None => {
                    self.unresolved += 1;
                    self.unconfirmed += u64::from(collides);
                    self.false_alarms += u64::from(!collides);
                    self.guess_errors += u64::from(self.last[pair] != collides);
                    self.ages[pair] += 1;
                    self.oldest = self.oldest.max(self.ages[pair]);
                }
            }
            if !collides && self.begun[pair].take().is_some() {
                self.missed += 1;
            }
        }
    }

    /// The share of pairs with a verdict.
    pub fn resolved(&self) -> f64 {
        1.0 - self.unresolved as f64 / self.pair_ticks as f64
    }

    /// Adds the figures that a single tick yields.
    pub fn tell(&self, row: Row) -> Row {
        row.put(
            "unresolved_percent",
            percent_of(self.unresolved, self.pair_ticks),
        )
        .put(
            "unconfirmed_percent",
            percent_of(self.unconfirmed, self.pair_ticks),
        )
        .put(
            "false_alarm_percent",
            percent_of(self.false_alarms, self.apart),
        )
        .put("wrong", self.wrong)
    }

    /// Adds the figures that need a run of many ticks.
    pub fn tell_run(&mut self, row: Row) -> Row {
        let pending = self.begun.iter().flatten().count() as u64;
        let row = self
            .tell(row)
            .put(
                "guess_error_percent",
                percent_of(self.guess_errors, self.pair_ticks),
            )
            .put("oldest_ticks", self.oldest)
            .put("onsets", self.onsets)
            .put("onsets_unreported", self.missed + pending);
        if self.delays.is_empty() {
            return row;
        }
        row.put("onset_p50_ticks", quantile(&mut self.delays, 0.5))
            .put("onset_p99_ticks", quantile(&mut self.delays, 0.99))
    }
}
