//! Geometry of a flight: flight lines, scan lines, and their parts.

use super::random::PulseRandom;
use super::survey::LidarSurvey;
use crate::hash::mix64;

/// Metres between flight lines.
const SPACING: f64 = 160.0;
/// Width of the swath of a line in metres.
const SWATH: f64 = 200.0;
/// Metres of a swath beyond the strip of its line, on either side.
const MARGIN: f64 = 0.5 * (SWATH - SPACING);
/// Flying height.
const ALTITUDE: f64 = 500.0;
/// Mean number of returns of a pulse.
const RETURNS: f64 = 1.13;
/// Approximate number of pulses of a part.
const PART: u64 = 1 << 16;
/// Maximum length of a part along its line in metres: its window of the ground stays small at any density.
const LONGEST: f64 = 1024.0;
/// Scan lines per second, and seconds for the turn between lines.
const SCANS_BY_SECOND: f64 = 100.0;
const TURN: f64 = 240.0;
/// GPS time of the start, less a billion seconds.
const START: f64 = 3.0e8;

/// The whole flight.
pub(super) struct Flight<'a> {
    survey: &'a LidarSurvey,
    lines: u64,
    /// Scan lines of a flight line, and metres between them.
    scans: u64,
    along: f64,
    /// Pulses of a scan line, and metres between them.
    pulses: u64,
    across: f64,
    /// Scan lines of a part.
    each: u64,
}

impl<'a> Flight<'a> {
    pub(super) fn new(survey: &'a LidarSurvey) -> Self {
        let lines = (survey.width / SPACING).ceil().max(1.0);
        let by_line =
            survey.density * survey.width / (seen(survey.width, lines) * mean_returns(survey));
        let step = 1.0 / by_line.sqrt();
        let pulses = (SWATH / step).ceil().max(2.0);
        let scans = (survey.height / step).ceil().max(1.0);
        let along = survey.height / scans;
        let each = (PART as f64 / pulses).min(LONGEST / along).max(1.0) as u64;
        let (lines, scans, pulses) = (lines as u64, scans as u64, pulses as u64);
        Self { survey, lines, scans, along, pulses, across: SWATH / pulses as f64, each }
    }

    fn parts_of_line(&self) -> u64 {
        self.scans.div_ceil(self.each)
    }

    pub(super) fn parts(&self) -> usize {
        (self.lines * self.parts_of_line()) as usize
    }

    /// The part of this index.
    pub(super) fn leg(&self, part: usize) -> FlightLeg<'_> {
        let line = part as u64 / self.parts_of_line();
        assert!(line < self.lines, "part {part} does not exist");
        let from = part as u64 % self.parts_of_line() * self.each;
        FlightLeg { flight: self, line, from, to: (from + self.each).min(self.scans) }
    }
}

/// Width of all swaths within a survey in metres, overlaps counted twice.
fn seen(width: f64, lines: f64) -> f64 {
    let before_last = if lines > 1.0 { beyond(lines - 2.0, width) } else { 0.0 };
    lines * SWATH - MARGIN - (beyond(lines - 1.0, width) + before_last)
}

/// Metres of a line's swath to the east of a survey.
fn beyond(line: f64, width: f64) -> f64 {
    ((line + 1.0) * SPACING + MARGIN - width).max(0.0)
}

fn mean_returns(survey: &LidarSurvey) -> f64 {
    if survey.cover { RETURNS } else { 1.0 }
}

/// A run of scan lines of one flight line.
pub(super) struct FlightLeg<'a> {
    flight: &'a Flight<'a>,
    line: u64,
    from: u64,
    to: u64,
}

/// A pulse: its position on the ground, and attributes of its emission.
pub(super) struct LaserPulse {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) dice: PulseRandom,
    /// A number from 0 up to 1.
    pub(super) luck: f64,
    pub(super) time: f64,
    /// Tangent of the beam's angle from the vertical, positive to the east.
    pub(super) tangent: f64,
    pub(super) source: u16,
    pub(super) overlap: bool,
    pub(super) eastward: bool,
    pub(super) edge: bool,
}

impl FlightLeg<'_> {
    /// West end of the swath, which may lie beyond the survey.
    fn west(&self) -> f64 {
        self.line as f64 * SPACING - MARGIN
    }

    /// Numbers, from the west, of the pulses of a scan line that may hit the survey.
    fn within(&self) -> std::ops::Range<u64> {
        let flight = self.flight;
        let [first, last] = [0.0, flight.survey.width].map(|x| (x - self.west()) / flight.across);
        // One more on either side: pulses stray from their places.
        let first = (first.floor() - 1.0).max(0.0) as u64;
        let last = (last.ceil() + 1.0) as u64;
        first..last.min(flight.pulses)
    }

    pub(super) fn pulses(&self) -> u64 {
        let within = self.within();
        (within.end - within.start) * (self.to - self.from)
    }

    /// Extent of the part, as [x min, y min, x max, y max] within the survey.
    pub(super) fn area(&self) -> [f64; 4] {
        let (survey, along) = (self.flight.survey, self.flight.along);
        let x = [self.west(), self.west() + SWATH].map(|x| x.clamp(0.0, survey.width));
        let ends = [self.from as f64 - 1.0, self.to as f64 + 1.0].map(|scan| scan * along);
        let y = ends.map(|way| self.northing(way).clamp(0.0, survey.height));
        [x[0], y[0].min(y[1]), x[1], y[0].max(y[1])]
    }

    /// y of a distance along the line: odd lines are flown to the south.
    fn northing(&self, way: f64) -> f64 {
        if self.line.is_multiple_of(2) { way } else { self.flight.survey.height - way }
    }

    /// Calls `each` for every pulse that hits the survey.
    pub(super) fn each_pulse(&self, mut each: impl FnMut(LaserPulse)) {
        for scan in self.from..self.to {
            self.each_of_scan(scan, &mut each);
        }
    }

    fn each_of_scan(&self, scan: u64, each: &mut impl FnMut(LaserPulse)) {
        let (survey, within) = (self.flight.survey, self.within());
        let eastward = !survey.zigzag || scan.is_multiple_of(2);
        let key = mix64(survey.key(1) ^ mix64(self.line << 32 | scan));
        for k in 0..within.end - within.start {
            let pulse = if eastward { within.start + k } else { within.end - 1 - k };
            let shot = self.shot(scan, pulse, eastward, PulseRandom(key ^ pulse));
            if (0.0..survey.width).contains(&shot.x) && (0.0..survey.height).contains(&shot.y) {
                each(shot);
            }
        }
    }

    /// A pulse by its number from the west. Its position is jittered by up to 0.4 of a step.
    #[inline(always)]
    fn shot(&self, scan: u64, pulse: u64, eastward: bool, mut dice: PulseRandom) -> LaserPulse {
        let flight = self.flight;
        let bits = dice.bits();
        let [right, ahead] = [0, 16].map(|at| f64::from((bits >> at) as u16) * (1.0 / 65_536.0));
        let x = self.west() + (pulse as f64 + 0.5 + 0.8 * (right - 0.5)) * flight.across;
        let share = (pulse as f64 + 0.5) / flight.pulses as f64;
        let done = if eastward { share } else { 1.0 - share };
        let place = if flight.survey.zigzag { done } else { 0.5 };
        let way = (scan as f64 + place + 0.8 * (ahead - 0.5)) * flight.along;
        let offset = x - (self.west() + 0.5 * SWATH);
        LaserPulse {
            x,
            y: self.northing(self.reflect(way)),
            dice,
            luck: f64::from((bits >> 32) as u32) * (1.0 / 4_294_967_296.0),
            time: self.time(scan, done),
            tangent: offset * (1.0 / ALTITUDE),
            source: (self.line + 1) as u16,
            overlap: offset.abs() > 0.5 * SPACING,
            eastward,
            edge: pulse == 0 || pulse + 1 == flight.pulses,
        }
    }

    /// Reflects distances beyond the ends of the line into the survey.
    fn reflect(&self, way: f64) -> f64 {
        let length = self.flight.survey.height;
        if way < 0.0 {
            -way
        } else if way >= length {
            2.0 * length - way
        } else {
            way
        }
    }

    fn time(&self, scan: u64, done: f64) -> f64 {
        let line = self.flight.scans as f64 / SCANS_BY_SECOND + TURN;
        START + self.line as f64 * line + (scan as f64 + done) / SCANS_BY_SECOND
    }
}
