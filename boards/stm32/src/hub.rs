//! The program of a hub, which is the same on each board: its statics, its tasks, and how they start.

/// Makes the program of a hub: statics, tasks, `Parts` and `start`.
///
/// A board adds its pins and `main`. `main` starts the clocks, calls `begin`, makes the
/// `Parts`, and calls `start`. The board's crate needs `cortex-m-rt`, `defmt`, `embassy-executor`, `embassy-stm32`,
/// `embassy-sync`, `motor-hub` and `static_cell`.
///
/// | name | what it is |
/// |---|---|
/// | `motors`, `pins`, `servos` | number of motors, and of digital pins and servo outputs for a host |
/// | `i2c` | type and number of the I2C buses for a host; left out on a board that has none |
/// | `pwm` | timer of the bridges, and the bit of RCC's register APB2ENR that gives the timer its clock |
/// | `directions` | GPIO ports of the lines that a fault must make low, each with the numbers of its lines: the bridges' direction lines, and the line that switches a transceiver to sending |
/// | `encoders`, `watchdog` | peripherals: timers of the encoders by motor, watchdog |
/// | `detector` | interrupt of the chip's voltage detector, and the register of PWR that sets the detector |
/// | `battery` | type of the converter of the battery |
/// | `sensors` | type that samples the DIAG lines of the bridges, and the currents on a board with a converter for them |
/// | `slot` | where a bootloader starts this image from: an `Option<Slot>` |
/// | `store` | flash that stores settings; left out on a board that stores none |
/// | `chain` | type of the line between the hubs of a chain; left out on a board that has none |
#[macro_export]
macro_rules! hub {
    (
        motors: $motors:literal,
        pins: $pins:literal,
        servos: $servos:literal,
        $(i2c: [$bus:ty; $buses:literal],)?
        pwm: $pwm:ident, $clock:ident,
        directions: { $($port:ident: $lines:expr),+ },
        encoders: [$($encoder:ident),+],
        watchdog: $watchdog:ident,
        detector: $detector:ident, $control:ident,
        battery: $battery:ty,
        sensors: $sensors:ty,
        slot: $slot:expr,
        $(store: $store:ty,)?
        $(chain: $chain:ty,)?
    ) => {
        /// Number of motors on this board.
        const MOTORS: usize = $motors;

        /// The control period: the milliseconds in `CONTROL_PERIOD_MS` at build time (1 to 100), or 50 ms without it.
        const PERIOD: ::motor_hub::units::Period = $crate::period(option_env!("CONTROL_PERIOD_MS"));

        /// All tasks run in one executor in thread mode, so no channel masks interrupts.
        static WIRES: ::motor_hub::tasks::Wires<
            ::embassy_sync::blocking_mutex::raw::ThreadModeRawMutex,
            MOTORS,
        > = ::motor_hub::tasks::Wires::new();

        static HEALTH: ::motor_hub::tasks::Health = ::motor_hub::tasks::Health::new()
            .expecting(::motor_hub::tasks::Task::Responder)
            .expecting(::motor_hub::tasks::Task::Bridges);

        /// Opens all bridges until a reset, from any context: PWM low first, then all direction lines.
        fn open_all_bridges() {
            use ::embassy_stm32::pac;
            // Without its clock the timer drives nothing, and an access would be a fault.
            if pac::RCC.apb2enr().read().$clock() {
                pac::$pwm.bdtr().modify(|w| w.set_moe(false));
            }
            $(
                pac::$port.bsrr().write(|w| {
                    for line in $lines {
                        w.set_br(line, true);
                    }
                });
            )+
        }

        const FAULTS: $crate::faults::FaultHandlers = $crate::faults::FaultHandlers {
            open_bridges: open_all_bridges,
            store_fault: |fault, detail| WIRES.report_crash(fault, detail),
        };

        #[panic_handler]
        fn panic(info: &::core::panic::PanicInfo<'_>) -> ! {
            FAULTS.panicked(info)
        }

        #[::cortex_m_rt::exception]
        #[allow(unsafe_code, reason = "cortex-m-rt asks for an unsafe fn; nothing in it is")]
        unsafe fn HardFault(frame: &::cortex_m_rt::ExceptionFrame) -> ! {
            FAULTS.hard_fault(frame)
        }

        #[::cortex_m_rt::exception]
        #[allow(unsafe_code, reason = "cortex-m-rt asks for an unsafe fn; nothing in it is")]
        unsafe fn DefaultHandler(irqn: i16) -> ! {
            FAULTS.unhandled(irqn)
        }

        type Encoders =
            $crate::encoders::QuadratureCounters<($($crate::encoders::Counter<::embassy_stm32::peripherals::$encoder>,)+)>;
        type Watchdog =
            ::embassy_stm32::wdg::IndependentWatchdog<'static, ::embassy_stm32::peripherals::$watchdog>;
        type Bridges = $crate::vnh5019::Vnh5019<::embassy_stm32::peripherals::$pwm, MOTORS>;

        /// The drivers of this board.
        struct Parts {
            watchdog: Watchdog,
            bridges: Bridges,
            sensors: $sensors,
            encoders: Encoders,
            battery: $battery,
            link: ($crate::serial::HostSender, $crate::serial::HostReceiver),
            connectors: $crate::connectors::Connectors<$pins, $servos>,
            $(buses: [$bus; $buses],)?
            lamp: $crate::lamp::Lamp,
            button: ::embassy_stm32::gpio::Input<'static>,
            $(store: Option<::motor_hub::tasks::store::Keeper<$store>>,)?
            $(
                /// `None` without a transceiver.
                chain: Option<$chain>,
            )?
        }

        /// Parts that the responder serves besides motors and connectors; true if the board has the part.
        struct OptionalParts {
            store: bool,
            chain: bool,
        }

        /// Starts the watchdog, opens the record of faults, and switches the voltage detector on. If the supply falls
        /// below the detector's level, the detector's interrupt ends the run.
        fn begin(watchdog: ::embassy_stm32::Peri<'static, ::embassy_stm32::peripherals::$watchdog>) -> Watchdog {
            use ::embassy_stm32::pac;
            $crate::status::started(env!("CARGO_PKG_NAME"));
            let watchdog = $crate::watchdog::start(watchdog);
            let (memory, cause) = (::defmt::unwrap!($crate::record::memory()), $crate::chip::reset_cause());
            if $crate::chip::RAM_HAS_ERROR_CODE && cause == ::motor_hub::record::Fault::PowerOn {
                memory.fill(0);
            }
            $crate::record::open(&WIRES, memory, cause);
            $crate::supply::enable_voltage_detector(pac::Interrupt::$detector, || {
                pac::PWR.$control().modify(|w| {
                    w.set_pls($crate::chip::PVD_LEVEL);
                    w.set_pvde(true);
                });
            });
            watchdog
        }

        use ::embassy_stm32::interrupt;

        #[interrupt]
        fn $detector() {
            FAULTS.supply_fell()
        }

        /// Starts all tasks.
        #[inline(never)]
        fn start(spawner: ::embassy_executor::Spawner, parts: Parts) {
            use ::defmt::unwrap;
            let hz = ::embassy_stm32::rcc::frequency::<::embassy_stm32::peripherals::$pwm>().0;
            ::defmt::info!("{=u32} Hz, {} motors every {=u32} ms", hz, MOTORS, PERIOD.as_millis());
            // The settings have the timing of a real VNH5019. The default settings have an ideal bridge.
            let settings = ::motor_hub::motor::Settings {
                bridge: ::motor_hub::bridge::BridgeConstants::VNH5019,
                ..::motor_hub::motor::Settings::new(::motor_hub::braking::Winding::NEVEREST_60)
            };
            spawner.spawn(unwrap!(output(parts.bridges)));
            spawner.spawn(unwrap!(bridge_sense(parts.sensors)));
            spawner.spawn(unwrap!(capture(parts.encoders)));
            spawner.spawn(unwrap!(supply(parts.battery)));
            spawner.spawn(unwrap!(control(settings)));
            spawner.spawn(unwrap!(health(parts.watchdog)));
            spawner.spawn(unwrap!(report()));
            #[allow(unused_mut, reason = "a board without a store has none to start")]
            let mut has_store = false;
            $(
                let keeper: Option<::motor_hub::tasks::store::Keeper<$store>> = parts.store;
                if let Some(keeper) = keeper {
                    has_store = true;
                    spawner.spawn(unwrap!(store(keeper)));
                }
            )?
            $(
                let buses: [$bus; $buses] = parts.buses;
                for (number, bus) in buses.into_iter().enumerate() {
                    spawner.spawn(unwrap!(i2c(bus, number)));
                }
            )?
            #[allow(unused_mut, reason = "a board without a chain line has none to start")]
            let mut has_chain = false;
            $(
                let line: Option<$chain> = parts.chain;
                if let Some(line) = line {
                    has_chain = true;
                    ::defmt::info!("a chain line");
                    spawner.spawn(unwrap!(chain(line)));
                }
            )?
            let (tx, rx) = parts.link;
            let state = new_responder(settings, OptionalParts { store: has_store, chain: has_chain });
            spawner.spawn(unwrap!(responder(rx, tx, parts.connectors, parts.lamp, state)));
            spawner.spawn(unwrap!(button(parts.button)));
        }

        #[::embassy_executor::task]
        async fn capture(encoders: Encoders) -> ! {
            ::motor_hub::tasks::capture::run(encoders, &WIRES, &HEALTH).await
        }

        #[::embassy_executor::task]
        async fn bridge_sense(sensors: $sensors) -> ! {
            $crate::Calibrate::calibrate(&sensors).await;
            ::motor_hub::tasks::bridges::run(sensors, &WIRES, &HEALTH).await
        }

        #[::embassy_executor::task]
        async fn supply(battery: $battery) -> ! {
            let supply = ::motor_hub::supply::Supply::new(::motor_hub::supply::Limits::default());
            $crate::Calibrate::calibrate(&battery).await;
            ::motor_hub::tasks::supply::run(battery, supply, &WIRES, &HEALTH).await
        }

        /// Makes the hub in static memory. As part of a task, the hub would take room from the stack while the task is started, and
        /// at each poll of the task.
        #[inline(never)]
        fn new_hub(settings: ::motor_hub::motor::Settings) -> &'static mut ::motor_hub::hub::Hub<MOTORS> {
            static HUB: ::static_cell::StaticCell<::motor_hub::hub::Hub<MOTORS>> = ::static_cell::StaticCell::new();
            HUB.init_with(|| ::motor_hub::hub::Hub::new([settings; MOTORS], PERIOD))
        }

        #[::embassy_executor::task]
        async fn control(settings: ::motor_hub::motor::Settings) -> ! {
            ::motor_hub::tasks::control::run(new_hub(settings), &WIRES, &HEALTH).await
        }

        #[::embassy_executor::task]
        async fn output(bridges: Bridges) -> ! {
            ::motor_hub::tasks::output::run(bridges, PERIOD, &WIRES, &HEALTH).await
        }

        #[::embassy_executor::task]
        async fn health(mut watchdog: Watchdog) -> ! {
            ::motor_hub::tasks::health::run(move || watchdog.pet(), &HEALTH).await
        }

        #[::embassy_executor::task]
        async fn report() -> ! {
            $crate::status::run(&WIRES).await
        }

        /// Makes the responder in static memory. Inlined into a task, the function would take room for one or two responders from
        /// the stack at each poll of the task.
        #[inline(never)]
        fn new_responder(
            settings: ::motor_hub::motor::Settings,
            has: OptionalParts,
        ) -> &'static mut ::motor_hub::responder::Responder<MOTORS> {
            static RESPONDER: ::static_cell::StaticCell<::motor_hub::responder::Responder<MOTORS>> =
                ::static_cell::StaticCell::new();
            let address = ::motor_hub::protocol::Address::DEFAULT;
            let mut responder = ::motor_hub::responder::Responder::new(address, [settings; MOTORS]);
            if has.store {
                responder = responder.expecting_store();
            }
            if has.chain {
                responder = responder.with_chain();
            }
            let slot: Option<::motor_hub::update::Slot> = $slot;
            if let Some(slot) = slot {
                responder = responder.with_slot(slot);
            }
            RESPONDER.init(responder)
        }

        /// Ends only if the serial line ends, which it never does.
        #[::embassy_executor::task]
        async fn responder(
            mut rx: $crate::serial::HostReceiver,
            mut tx: $crate::serial::HostSender,
            mut connectors: $crate::connectors::Connectors<$pins, $servos>,
            mut lamp: $crate::lamp::Lamp,
            responder: &'static mut ::motor_hub::responder::Responder<MOTORS>,
        ) {
            // The task shows the lamp at least every 100 ms, also while the line is silent or busy.
            let show = |colour| {
                lamp.show(colour);
                HEALTH.check_in(::motor_hub::tasks::Task::Responder);
            };
            // An async function keeps two copies of an owned argument, so the arguments are borrowed.
            ::motor_hub::tasks::responder::run(&mut rx, &mut tx, &mut connectors, responder, &WIRES, show).await;
        }

        $(
            #[::embassy_executor::task]
            async fn store(keeper: ::motor_hub::tasks::store::Keeper<$store>) -> ! {
                ::motor_hub::tasks::store::run(keeper, &WIRES).await
            }
        )?

        $(
            #[::embassy_executor::task(pool_size = $buses)]
            async fn i2c(bus: $bus, number: usize) -> ! {
                ::motor_hub::tasks::i2c::run(bus, number, &WIRES).await
            }
        )?

        $(
            /// Ends only if the serial line ends, which it never does.
            #[::embassy_executor::task]
            async fn chain(line: $chain) {
                let (tx, rx) = line;
                ::motor_hub::tasks::chain::run(rx, tx, &WIRES).await;
            }
        )?

        #[::embassy_executor::task]
        async fn button(button: ::embassy_stm32::gpio::Input<'static>) -> ! {
            $crate::button::run(button, &WIRES).await
        }
    };
}
