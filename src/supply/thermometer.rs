//! Converts readings of a chip's temperature sensor.

use super::VrefintCalibration;

/// Temperatures at which the factory reads the sensor, in 0.1 degrees Celsius (DS9405, DS12110, temperature sensor
/// calibration values).
const CALIBRATED_DECIDEGREES: [i64; 2] = [300, 1100];

/// Factory calibration of a chip's temperature sensor, whose voltage is linear in the temperature.
///
/// ```
/// use motor_hub::supply::{Thermometer, VrefintCalibration};
/// use motor_hub::units::Millivolts;
///
/// let thermometer = Thermometer { readings: [960, 1200] };
/// let reference = VrefintCalibration { reading: 1500, rail: Millivolts::new(3_300), bits: 12 };
/// assert_eq!(thermometer.decidegrees(960, 1500, reference), Some(300));
/// // The rail is 3.0 V: both readings are higher by a tenth.
/// assert_eq!(thermometer.decidegrees(1188, 1650, reference), Some(700));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Thermometer {
    /// Readings of the sensor at 30 and at 110 degrees Celsius. The supply voltage of the ADC, the *rail*, was then
    /// [`VrefintCalibration::rail`].
    pub readings: [u16; 2],
}

impl Thermometer {
    /// Returns the temperature in 0.1 degrees Celsius, from readings of the sensor and of the internal voltage
    /// reference VREFINT. `None` if both calibration readings are equal, if `vrefint` is 0, or if the result is not
    /// within +-3000 degrees.
    pub fn decidegrees(self, sensor: u16, vrefint: u16, reference: VrefintCalibration) -> Option<i16> {
        let [low, high] = self.readings.map(i64::from);
        let [cold, hot] = CALIBRATED_DECIDEGREES;
        // The reading that the sensor would have with the rail at which it was calibrated.
        let reading = (i64::from(sensor) * i64::from(reference.reading)).checked_div(i64::from(vrefint))?;
        let above = ((reading - low) * (hot - cold)).checked_div(high - low)?;
        i16::try_from(cold + above).ok().filter(|temperature| temperature.unsigned_abs() < 30_000)
    }
}
