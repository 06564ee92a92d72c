from ranger_sim.boards.firmware_board cimport SatelliteBoard
from ranger_sim.boards.modules.absolute_encoder cimport AbsoluteEncoder
from ranger_sim.boards.modules.adc_readings cimport AdcReadings
from ranger_sim.boards.modules.compliant_control cimport CompliantControl
from ranger_sim.boards.modules.current_control cimport CurrentControl
from ranger_sim.boards.modules.encoder_capture cimport EncoderCapture, WrapCounter
from ranger_sim.boards.modules.motor_limits cimport MotorLimits
from ranger_sim.boards.modules.motor_output cimport MotorOutput
from ranger_sim.boards.modules.quadrature_decoder cimport QuadratureDecoder
from ranger_sim.firmware_sim.alarm cimport Alarm
from ranger_sim.firmware_sim.peripheral cimport Peripheral
from ranger_sim.firmware_sim.peripherals.adc_external cimport Ads7871
from ranger_sim.firmware_sim.peripherals.adc_internal cimport AdcInternal
from ranger_sim.firmware_sim.peripherals.pwm cimport Pwm
from ranger_sim.firmware_sim.peripherals.spi_encoder cimport SpiEncoder
from ranger_sim.firmware_sim.peripherals.timer_capture cimport TimerCapture
from ranger_sim.foundation.numbers cimport fixed_of_float, float32

cpdef enum:
    BATTERY_VOLTAGE_CHANNEL = 1

cdef class PowerUp(Peripheral):
    cdef public MotorBoard board
    cdef public Alarm first, second
    cpdef int begin(self, long long phase_ns) except -1

cdef class MotorBoard(SatelliteBoard):
    # what the tasks of every slot and the interrupts touch
    cdef public Ads7871 adc_external
    cdef public AdcInternal adc_internal
    cdef public SpiEncoder spi
    cdef public AbsoluteEncoder encoder
    cdef public QuadratureDecoder motor
    cdef public CompliantControl compliance
    cdef public MotorLimits limits
    cdef public CurrentControl current_control
    cdef public AdcReadings readings
    # the rest
    cdef public Pwm pwm
    cdef public MotorOutput output
    cdef public QuadratureDecoder cap01, cap23
    cdef public EncoderCapture capture01, capture23
    cdef public WrapCounter wraps
    cdef public TimerCapture timer0
    cdef public long long encoder_select, rezero_count
    cdef public bint rezeroing
    cdef public PowerUp power_up
    cpdef int read_sensors_once(self) except -1
    cpdef int set_start_values(self) except -1
    cpdef long long controlled_position(self) noexcept
    cpdef long long controlled_velocity(self) noexcept
    cpdef int rezero_motor(self, double share) except -1
