"""Boots the image of a NUCLEO-F429ZI on Unicorn, an emulator that shares no code with the emulator of this folder's bench.

    python3 second_emulator.py IMAGE.elf

It checks clocks, pins, PWM, watchdog and host link after the boot, and the answer to REV's discovery. Unicorn executes the
instructions of the core. Everything else is here, from RM0090 and PM0214: the interrupt controller, TIM5 and USART3 as far as
the image uses them, and ready bits. All other registers store what is written to them.

It does not check times (an instruction takes one cycle, and registers answer without delay), encoders, bridges in motion,
flash writes, the memory protection unit, or faults. The bench does.
"""

import struct
import sys

import unicorn
from elftools.elf.elffile import ELFFile
from unicorn import arm_const as arm

CYCLES_PER_US = 168
MS = 1000 * CYCLES_PER_US

FLASH, RAM, FACTORY_WORDS = 0x0800_0000, 0x2000_0000, 0x1FFF_0000
RCC, FLASH_INTERFACE, PWR, IWDG, DBGMCU = 0x4002_3800, 0x4002_3C00, 0x4000_7000, 0x4000_3000, 0xE004_2000
TIM1, TIM5, USART3, ADC1, ADC3 = 0x4001_0000, 0x4000_0C00, 0x4000_4800, 0x4001_2000, 0x4001_2200
GPIOA, GPIOD = 0x4002_0000, 0x4002_0C00
NVIC = 0xE000_E100
TIM5_LINE, USART3_LINE = 50, 39

# Reading of VREFINT, 1.21 V on 3.3 V with 12 bits, and of a battery of 12 V behind 82 and 10 kohm.
VREFINT, BATTERY = 1502, 1619
# Opcodes of WFE and SEV (ARMv7-M ARM A7.7).
WFE, SEV = b"\x20\xbf", b"\x40\xbf"
# Number of the exception that Unicorn reports for an exception return.
EXCEPTION_RETURN = 8
# Registers that the core stacks on exception entry, in this order, before PC and xPSR (PM0214 2.3.7).
STACKED = [
    *(arm.UC_ARM_REG_R0, arm.UC_ARM_REG_R1, arm.UC_ARM_REG_R2, arm.UC_ARM_REG_R3),
    *(arm.UC_ARM_REG_R12, arm.UC_ARM_REG_LR),
]
FLOATS = range(arm.UC_ARM_REG_S0, arm.UC_ARM_REG_S0 + 16)


def bits(value, pairs):
    """Copies bits of a register: each ready bit follows its enable bit."""
    for enable, ready in pairs:
        value = value & ~(1 << ready) | (value >> enable & 1) << ready
    return value


class Chip:
    """The chip around Unicorn's core."""

    def __init__(self, image):
        self.cycles = 0
        # The flag of a power-on reset, and revision 3 of an STM32F42x.
        self.registers = {RCC + 0x74: 1 << 27, DBGMCU: 0x2001_0419, RCC: 0x83}
        self.timer_start = None
        self.timer_seen = 0
        self.received, self.sent = [], bytearray()
        self.idle = False
        self.enabled, self.pending = set(), set()
        self.feeds = 0
        self.frames = []
        self.event = False
        self.exception = None
        self.core = unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS)
        self.core.ctl_set_cpu_model(arm.UC_CPU_ARM_CORTEX_M4)
        for start, size in ((FLASH, 2 << 20), (RAM, 192 << 10), (FACTORY_WORDS, 64 << 10)):
            self.core.mem_map(start, size)
        self.core.mem_write(FLASH, b"\xff" * (2 << 20))
        self.core.mem_write(0x1FFF_7A2A, struct.pack("<H", VREFINT))
        with open(image, "rb") as file:
            for segment in ELFFile(file).iter_segments():
                if segment["p_type"] == "PT_LOAD" and segment["p_filesz"]:
                    self.core.mem_write(segment["p_paddr"], segment.data())
        for start, size in ((0x4000_0000, 0x1000_0000), (0xE000_0000, 0x10_0000)):
            self.core.mmio_map(start, size, self.load, start, self.store, start)
        self.core.hook_add(unicorn.UC_HOOK_INTR, self.interrupted)
        code = bytes(self.core.mem_read(FLASH, 1 << 20))
        for at in range(0, len(code), 2):
            if code[at : at + 2] == SEV:
                self.core.hook_add(unicorn.UC_HOOK_CODE, self.send_event, None, FLASH + at, FLASH + at)
        stack, self.pc = struct.unpack("<II", self.core.mem_read(FLASH, 8))
        self.core.reg_write(arm.UC_ARM_REG_SP, stack)

    # Registers

    def load(self, _, offset, size, start):
        at = start + offset
        word = self.read(at & ~3)
        return word >> 8 * (at & 3) & (1 << 8 * size) - 1

    def store(self, _, offset, size, value, start):
        at = start + offset
        if size < 4:
            shift = 8 * (at & 3)
            mask = (1 << 8 * size) - 1 << shift
            at &= ~3
            value = self.registers.get(at, 0) & ~mask | value << shift & mask
        self.write(at, value)

    def read(self, at):
        value = self.registers.get(at, 0)
        if at == RCC:  # HSI, HSE, PLL, PLLI2S, PLLSAI
            return bits(value, [(0, 1), (16, 17), (24, 25), (26, 27), (28, 29)])
        if at == RCC + 0x08:  # SWS follows SW
            return bits(value, [(0, 2), (1, 3)])
        if at == RCC + 0x74:  # LSI
            return bits(value, [(0, 1)])
        if at == PWR + 4:  # VOSRDY, and over-drive
            return bits(self.registers.get(PWR, 0), [(16, 16), (17, 17)]) & 3 << 16 | 1 << 14
        if at in (IWDG + 0x0C, FLASH_INTERFACE + 0x0C):  # Never busy
            return 0
        if at == TIM5 + 0x24:
            return self.timer() & 0xFFFF if self.timer_start is not None else value
        if at == USART3:  # TXE, TC, RXNE, IDLE
            return 0xC0 | bool(self.received) << 5 | self.idle << 4
        if at == USART3 + 4:  # Also clears IDLE
            self.idle = False
            return self.received.pop(0) if self.received else 0
        if at in (ADC1, ADC3):  # EOC, JEOC
            return value | 0b110
        if at == ADC1 + 0x4C:
            return BATTERY
        if at == ADC1 + 0x3C:
            return VREFINT
        if GPIOA <= at < GPIOA + 0x2800 and at & 0x3FF == 0x10:  # Pins are high, but PC13: the button is not pressed.
            return 0xDFFF if at == GPIOA + 0x810 else 0xFFFF
        return value

    def write(self, at, value):
        if at == TIM5 and value & 1 and self.timer_start is None:
            self.timer_start = self.cycles
        elif at == TIM5 + 0x10:  # Flags are cleared by zeros.
            value &= self.registers.get(at, 0)
        elif at == USART3 + 4:
            self.sent.append(value & 0xFF)
            return
        elif at == IWDG and value == 0xAAAA:
            self.feeds += 1
        elif GPIOA <= at < GPIOA + 0x2800 and at & 0x3FF == 0x18:  # BSRR
            output = at - 4
            self.registers[output] = self.registers.get(output, 0) & ~(value >> 16) | value & 0xFFFF
            return
        for first, change in (
            (0x000, self.enabled.add),
            (0x080, self.enabled.discard),
            (0x100, self.pending.add),
            (0x180, self.pending.discard),
        ):
            if NVIC + first <= at < NVIC + first + 0x20:
                for bit in range(32):
                    if value >> bit & 1:
                        change(8 * (at - NVIC - first) + bit)
                return
        self.registers[at] = value

    # Time and interrupts

    def timer(self):
        """TIM5, which counts microseconds."""
        return (self.cycles - self.timer_start) // CYCLES_PER_US

    def compares(self):
        return [self.registers.get(TIM5 + 0x34 + 4 * channel, 0) & 0xFFFF for channel in range(4)]

    def advance(self):
        """Raises the timer's flags. Returns the cycles until the next flag."""
        if self.timer_start is None:
            return MS
        now, flags = self.timer(), self.registers.get(TIM5 + 0x10, 0)
        for bit, at in enumerate([0, *self.compares()]):
            if (now - at) >> 16 != (self.timer_seen - at) >> 16:
                flags |= 1 << bit
        self.timer_seen = now
        self.registers[TIM5 + 0x10] = flags
        wait = min((at - now - 1 & 0xFFFF) + 1 for at in [0, *self.compares()])
        return (now + wait) * CYCLES_PER_US + self.timer_start - self.cycles

    def lines(self):
        """Pending interrupts that are enabled."""
        lines = set(self.pending)
        if self.registers.get(TIM5 + 0x10, 0) & self.registers.get(TIM5 + 0x0C, 0) & 0x1F:
            lines.add(TIM5_LINE)
        control = self.registers.get(USART3 + 0x0C, 0)
        if self.read(USART3) & control & 0xF0:
            lines.add(USART3_LINE)
        return lines & self.enabled

    def enter(self, line):
        core = self.core
        stack = core.reg_read(arm.UC_ARM_REG_SP)
        padding = stack & 4
        frame = [core.reg_read(register) for register in STACKED]
        frame += [self.pc & ~1, core.reg_read(arm.UC_ARM_REG_XPSR)]
        self.frames.append((padding, [core.reg_read(register) for register in FLOATS]))
        stack -= padding + 32
        core.mem_write(stack, struct.pack("<8I", *frame))
        core.reg_write(arm.UC_ARM_REG_SP, stack)
        core.reg_write(arm.UC_ARM_REG_IPSR, 16 + line)
        core.reg_write(arm.UC_ARM_REG_LR, 0xFFFF_FFF9)
        self.pending.discard(line)
        (self.pc,) = struct.unpack("<I", core.mem_read(FLASH + 4 * (16 + line), 4))

    def leave(self):
        core = self.core
        stack = core.reg_read(arm.UC_ARM_REG_SP)
        *registers, pc, status = struct.unpack("<8I", core.mem_read(stack, 32))
        padding, floats = self.frames.pop()
        core.reg_write(arm.UC_ARM_REG_SP, stack + 32 + padding)
        core.reg_write(arm.UC_ARM_REG_IPSR, 0)
        for register, value in zip([*STACKED, *FLOATS], [*registers, *floats]):
            core.reg_write(register, value)
        core.reg_write(arm.UC_ARM_REG_XPSR_NZCVQG, status & 0xF80F_0000)
        self.pc = pc | 1

    def interrupted(self, core, number, _):
        self.exception = number
        core.emu_stop()

    def send_event(self, *_):
        self.event = True

    def run(self, cycles):
        """Runs for this many cycles, a few thousand at a time."""
        end = self.cycles + cycles
        while self.cycles < end:
            wait = self.advance()
            if not self.frames and not self.core.reg_read(arm.UC_ARM_REG_PRIMASK):
                if lines := self.lines():
                    self.enter(min(lines))
            count = max(1, min(wait, 4000, end - self.cycles))
            self.exception, sleeps = None, False
            try:
                self.core.emu_start(self.pc | 1, 0xFFFF_FFFF, count=count)
            except unicorn.UcError as error:
                # Unicorn stops at WFE with an error.
                at = self.core.reg_read(arm.UC_ARM_REG_PC)
                if bytes(self.core.mem_read(at, 2)) == WFE:
                    self.core.reg_write(arm.UC_ARM_REG_PC, at + 2)
                    sleeps = True
                elif bytes(self.core.mem_read(at - 2, 2)) == WFE:
                    sleeps = True
                elif self.exception is None:
                    sys.exit(f"{error} at {at:#x}")
            if self.exception == EXCEPTION_RETURN:
                self.leave()
                self.cycles += min(count, 100)
                continue
            if self.exception is not None:
                sys.exit(f"exception {self.exception} at {self.core.reg_read(arm.UC_ARM_REG_PC):#x}")
            self.pc = self.core.reg_read(arm.UC_ARM_REG_PC) | 1
            if not sleeps:
                self.cycles += count
                continue
            self.cycles += 50
            if self.event:
                self.event = False
            elif not self.lines():
                self.cycles += max(0, min(self.advance(), end - self.cycles))

    def receive(self, packet):
        """Sends bytes to the chip, 22 us each, and lets the line be idle for 20 ms."""
        for byte in packet:
            self.received.append(byte)
            self.run(22 * CYCLES_PER_US)
        self.idle = True
        self.run(20 * MS)


def packet(destination, source, number, answers, kind, payload=b""):
    """A packet of REV's protocol."""
    body = struct.pack("<2sHBBBBH", b"DK", 11 + len(payload), destination, source, number, answers, kind) + payload
    return body + bytes([sum(body) & 0xFF])


def check(what, found, expected):
    print(f"{what}: {found}")
    if found != expected:
        sys.exit(f"{what}: expected {expected}")


def main(image):
    chip = Chip(image)
    chip.run(300 * MS)
    register = chip.registers.get
    check("system clock from the PLL", chip.read(RCC + 0x08) >> 2 & 3, 2)
    # PLLM 8, PLLN 168, PLLP 2: 16 MHz times 168 / 8 / 2 is 168 MHz.
    pll = register(RCC + 4)
    check("PLLM, PLLN, PLLP, HSE", [pll & 0x3F, pll >> 6 & 0x1FF, pll >> 16 & 3, pll >> 22 & 1], [8, 168, 0, 0])
    check("flash wait states", register(FLASH_INTERFACE) & 0xF, 5)
    # 168 MHz over 20 kHz, all duties 0, main output on.
    check("PWM period", register(TIM1 + 0x2C) + 1, 8400)
    check("PWM duties", [register(TIM1 + 0x34 + 4 * channel, 0) for channel in range(4)], [0, 0, 0, 0])
    check("PWM output", register(TIM1 + 0x44) >> 15 & 1, 1)
    check("direction lines are outputs", register(GPIOD) & 0xFFFF, 0x5555)
    check("direction lines", register(GPIOD + 0x14, 0) & 0xFF, 0)
    # 42 MHz over 460 800 baud, rounded.
    check("baud rate divider", register(USART3 + 8), 91)
    check("watchdog is fed", chip.feeds > 3, True)
    chip.sent.clear()
    chip.receive(packet(255, 0, 1, 0, 0x7F0F))
    # The hub's address is 2, it answers packet 1, and it is a parent.
    check("answer to discovery", chip.sent.hex(" "), packet(0, 2, 1, 1, 0xFF0F, b"\x01").hex(" "))


main(*sys.argv[1:])
