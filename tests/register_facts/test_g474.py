"""The second chip: its registers.h, and what its sources connect, against the public description.

The rules are those of test_registers.py: a macro named as its field is looked up by that name, the others are
spelled out as PERIPHERAL.register.field=value.
"""

import csv
import re

import pytest

from tests.register_facts.chip import G474 as CHIP
from tests.register_facts.header import G474 as HEADER

PERIPHERAL = {
    "ADC": "ADC1", "ADC_COMMON": "ADC12_COMMON", "TIM": "TIM2", "USART": "USART2", "FDCAN": "FDCAN1",
    "UNIQUE_ID": "UID",
}  # fmt: skip
REGISTER = {
    "DMA1.CH[1]": "ch[1]", "DMAMUX1.CCR[1]": "ccr[1]", "TIM2.CCMR1": "ccmr_input[0]",
    "TIM2.CCMR2": "ccmr_input[1]", "FDCAN1.RXF0S": "rxfs[0]", "FDCAN1.RXF0A": "rxfa[0]",
    "FDCAN1.RXF1S": "rxfs[1]", "FDCAN1.RXF1A": "rxfa[1]",
    **{f"TIM2.CCR{n}": f"ccr[{n - 1}]" for n in (1, 2, 3, 4)},
}  # fmt: skip
FLAGS = ("gif", "tcif", "htif", "teif")
SPELLED = {
    "FLASH_ACR_LATENCY_4": "FLASH.acr.latency=WS4",
    "FLASH_ACR_LATENCY_Msk": "FLASH.acr.latency=mask",
    "FLASH_SR_ERRORS": [
        f"FLASH.sr.{e}=1"
        for e in ("operr", "progerr", "wrperr", "pgaerr", "sizerr", "pgserr", "miserr", "fasterr", "rderr",
                  "optverr")
    ],
    "FLASH_CR_PNB_Pos": "FLASH.cr.pnb=position",
    "RCC_PLLCFGR_SRC_HSI": "RCC.pllcfgr.pllsrc=HSI",
    "RCC_PLLCFGR_SRC_HSE": "RCC.pllcfgr.pllsrc=HSE",
    "RCC_PLLCFGR_M_Pos": "RCC.pllcfgr.pllm=position",
    "RCC_PLLCFGR_N_Pos": "RCC.pllcfgr.plln=position",
    "RCC_PLLCFGR_R_2": "RCC.pllcfgr.pllr=DIV2",
    "RCC_CFGR_SW_PLL": "RCC.cfgr.sw=PLL1_R",
    "RCC_CFGR_SWS_Msk": "RCC.cfgr.sws=mask",
    "RCC_CFGR_SWS_PLL": "RCC.cfgr.sws=PLL1_R",
    "RCC_CFGR_HPRE_2": "RCC.cfgr.hpre=DIV2",
    "RCC_CCIPR_FDCANSEL_PCLK": "RCC.ccipr.fdcansel=PCLK1",
    "DMA_CR_FROM_MEMORY": "DMA1.ch[0].cr.dir=FROM_MEMORY",
    "DMA_CR_WORDS": ["DMA1.ch[0].cr.psize=BITS32", "DMA1.ch[0].cr.msize=BITS32"],
    "DMA_CR_VERY_HIGH": "DMA1.ch[0].cr.pl=VERY_HIGH",
    "DMA_ISR_TEIF(0)": "DMA1.isr.teif[0]=1",
    "DMA_ISR_TEIF(1)": "DMA1.isr.teif[1]=1",
    "DMA_IFCR_ALL(0)": [f"DMA1.ifcr.{flag}[0]=1" for flag in FLAGS],
    "DMA_IFCR_ALL(1)": [f"DMA1.ifcr.{flag}[1]=1" for flag in FLAGS],
    "ADC_CFGR_EXTEN_RISING": "ADC1.cfgr.exten=RISING_EDGE",
    "ADC_CFGR2_OVSR_16": "ADC1.cfgr2.ovsr=3",
    "ADC_SMP_12_CYCLES": "ADC1.smpr.smp[0]=CYCLES12_5",
    "ADC_SMP_247_CYCLES": "ADC1.smpr.smp[0]=CYCLES247_5",
    "ADC_SQR1_ONE(0)": "ADC1.sqr1.sq[0]=0",
    "ADC_SQR1_ONE(1)": "ADC1.sqr1.sq[0]=1",
    "ADC_JSQR_ONE(0)": "ADC1.jsqr.jsq[0]=0",
    "ADC_JSQR_ONE(1)": "ADC1.jsqr.jsq[0]=1",
    "ADC_CCR_DUAL": "ADC12_COMMON.ccr.dual=6",
    "ADC_CCR_DMACFG": "ADC12_COMMON.ccr.dmacfg=1",
    "ADC_CCR_MDMA_BOTH": "ADC12_COMMON.ccr.mdma=2",
    "ADC_CCR_HCLK_BY_4": "ADC12_COMMON.ccr.ckmode=3",
    "ADC_CCR_VREFEN": "ADC12_COMMON.ccr.vrefen=1",
    "TIM_CR2_MMS_UPDATE": "TIM2.cr2.mms=UPDATE",
    "TIM_SMCR_SMS_ENCODER": "TIM2.smcr.sms=ENCODER_MODE_3",
    "TIM_SMCR_SMS_TRIGGER": "TIM2.smcr.sms=TRIGGER_MODE",
    "TIM_SMCR_SMS_EXTERNAL_1": "TIM15.smcr.sms=EXT_CLOCK_MODE",
    "TIM_SMCR_TS_ITR(0)": "TIM2.smcr.ts=ITR0",
    "TIM_SMCR_TS_ITR(1)": "TIM2.smcr.ts=ITR1",
    "TIM_DIER_CC3DE": "TIM2.dier.ccde[2]=1",
    "TIM_SR_CC1IF": "TIM4.sr.ccif[0]=1",
    "TIM_SR_CC1OF": "TIM4.sr.ccof[0]=1",
    # The description names the code 01 after channel 4's own input.
    "TIM_CCMR1_CC1S_TI1": "TIM2.ccmr_input[0].ccs[0]=TI4",
    "TIM_CCMR1_IC1F(0)": "TIM2.ccmr_input[0].icf[0]=NO_FILTER",
    "TIM_CCMR1_IC1F(1)": "TIM2.ccmr_input[0].icf[0]=FCK_INT_N2",
    "TIM_CCMR1_CC2S_TI2": "TIM2.ccmr_input[0].ccs[1]=TI4",
    "TIM_CCMR1_IC2F(0)": "TIM2.ccmr_input[0].icf[1]=NO_FILTER",
    "TIM_CCMR1_IC2F(1)": "TIM2.ccmr_input[0].icf[1]=FCK_INT_N2",
    "TIM_CCMR2_CC3S_TRC": "TIM2.ccmr_input[1].ccs[0]=TRC",
    "TIM_CCMR1_OC1M_TOGGLE": "TIM2.ccmr_output[0].ocm[0]=TOGGLE",
    "TIM_CCMR1_OC1M_FORCE_LOW": "TIM2.ccmr_output[0].ocm[0]=FORCE_INACTIVE",
    "TIM_CCER_CC1E": "TIM2.ccer.cce[0]=1",
    "TIM_CCER_CC3E": "TIM2.ccer.cce[2]=1",
    "IWDG_KR_UNLOCK": "IWDG.kr.key=ENABLE",
    "IWDG_KR_REFRESH": "IWDG.kr.key=RESET",
    "IWDG_KR_START": "IWDG.kr.key=START",
    "IWDG_PR_32": "IWDG.pr.pr=DIVIDE_BY32",
    "USART_ISR_ERRORS": [f"USART2.isr.{flag}=1" for flag in ("fe", "ne", "ore")],
    "FDCAN_NBTP_NTSEG2_Pos": "FDCAN1.nbtp.ntseg2=position",
    "FDCAN_NBTP_NTSEG1_Pos": "FDCAN1.nbtp.ntseg1=position",
    "FDCAN_NBTP_NBRP_Pos": "FDCAN1.nbtp.nbrp=position",
    "FDCAN_NBTP_NSJW_Pos": "FDCAN1.nbtp.nsjw=position",
    "FDCAN_ECR_TEC_Pos": "FDCAN1.ecr.tec=position",
    "FDCAN_ECR_REC_Pos": "FDCAN1.ecr.rec=position",
    "FDCAN_IR_RF0N": "FDCAN1.ir.rfn[0]=1",
    "FDCAN_IR_RF0L": "FDCAN1.ir.rfl[0]=1",
    "FDCAN_IE_RF0N": "FDCAN1.ie.rfne[0]=1",
    "FDCAN_IE_RF0L": "FDCAN1.ie.rfle[0]=1",
    "FDCAN_IE_TC": "FDCAN1.ie.tce=1",
    "FDCAN_IE_BO": "FDCAN1.ie.boe=1",
    "FDCAN_ILE_BOTH": ["FDCAN1.ile.eint0=1", "FDCAN1.ile.eint1=1"],
    "FDCAN_RXGFC_REJECT": [
        "FDCAN1.rxgfc.rrfe=1", "FDCAN1.rxgfc.rrfs=1", "FDCAN1.rxgfc.anfe=REJECT",
        "FDCAN1.rxgfc.anfs=REJECT",
    ],
    "FDCAN_RXGFC_LSS_Pos": "FDCAN1.rxgfc.lss=position",
    "FDCAN_RXF0S_F0FL_Msk": "FDCAN1.rxfs[0].ffl=mask",
    "FDCAN_RXF0S_F0GI_Pos": "FDCAN1.rxfs[0].fgi=position",
    "FDCAN_TXFQS_TFFL_Msk": "FDCAN1.txfqs.tffl=mask",
    "FDCAN_TXFQS_TFQPI_Pos": "FDCAN1.txfqs.tfqpi=position",
    "FDCAN_TXBTIE_ALL": [f"FDCAN1.txbtie.tie[{n}]=1" for n in range(3)],
}  # fmt: skip
# What the description does not hold, with the place that says it.
STATED = {
    "FLASH_KEY1": 0x45670123,  # RM0440, unlocking the flash memory
    "FLASH_KEY2": 0xCDEF89AB,
    "ADC_VREFINT_CHANNEL": 18,  # RM0440, ADC connectivity: VREFINT is input 18 of ADC1
    "ADC_CFGR_EXTSEL_TIM3": 4 << 5,  # RM0440, external triggers of ADC1 and ADC2: event 4, TIM3_TRGO
    "VREFINT_CAL": 0x1FFF75AA,  # data sheet, internal voltage reference calibration values
    "FDCAN_FILTER_TWO_IDS": 1 << 30 | 1 << 27,  # RM0440, FDCAN standard message ID filter element
    "FDCAN_FILTER_ID1_Pos": 16,
    "FDCAN_ELEMENT_ID_Pos": 18,  # FDCAN Rx FIFO element, Tx buffer element
    "FDCAN_ELEMENT_DLC_Pos": 16,
    "SCB_CFSR_MMARVALID": 1 << 7,  # Armv7-M architecture, B3.2.15
    "SCB_CFSR_BFARVALID": 1 << 15,
    "SCB_ICSR_VECTACTIVE": 0x1FF,  # B3.2.4
    "NVIC_IPR": 0xE000E400,  # B3.4.9
}
# As of the first chip, where the crate cortex-m says so: the processor is the same.
PROCESSOR = ("SCB", "NVIC_ISER", "SCB_AIRCR_RESET")
RCC_ENABLE = re.compile(r"RCC_(A[HP]B\dENR\d?)_(\w+)")
SIGNALS = {
    "ENCODER_1_A": ("TIM2", "CH1"), "ENCODER_1_B": ("TIM2", "CH2"), "ENCODER_2_A": ("TIM5", "CH1"),
    "ENCODER_2_B": ("TIM5", "CH2"), "SYNC": ("TIM4", "CH1"), "SERIAL_TX": ("USART2", "TX"),
    "SERIAL_RX": ("USART2", "RX"), "CAN_TX": ("FDCAN1", "TX"), "CAN_RX": ("FDCAN1", "RX"),
    "EDGE": ("TIM3", "CH1"),
}  # fmt: skip
SOURCES = HEADER.sources()
BOARD = (HEADER.port.parent / "nucleo_g474re" / "board.h").read_text(encoding="utf-8")
PINS = {
    signal: f"P{port}{number}"
    for signal, port, number in re.findall(r"#define BOARD_(\w+)\s+PIN\(GPIO(\w), (\d+)\)", BOARD)
}


def register_path(peripheral: str, name: str) -> str:
    return REGISTER.get(f"{peripheral}.{name}", name.lower())


def by_name(macro: str) -> int:
    if enable := RCC_ENABLE.fullmatch(macro):
        return CHIP.bits(f"RCC.{enable[1].lower()}.{enable[2].lower()}en=1")
    prefix, name, field = macro.split("_", 2)
    if prefix == "DMA":
        return CHIP.bits(f"DMA1.ch[0].{name.lower()}.{field.lower()}=1")
    peripheral = PERIPHERAL.get(prefix, prefix)
    return CHIP.bits(f"{peripheral}.{register_path(peripheral, name)}.{field.lower()}=1")


def constants() -> list[str]:
    return [n for n in HEADER.values() if "." not in n and (n not in HEADER.blocks or n in STATED)]


@pytest.mark.parametrize("macro", [m for m in constants() if m not in PROCESSOR])
def test_the_bits_of_a_macro(macro: str) -> None:
    told = HEADER.values()[macro]
    spelled = SPELLED.get(macro)
    if macro in STATED:
        assert told == STATED[macro]
    elif spelled is None:
        assert told == by_name(macro)
    else:
        assert told == sum(map(CHIP.bits, [spelled] if isinstance(spelled, str) else spelled))


def test_nothing_is_spelled_that_is_not_there() -> None:
    assert set(SPELLED) | set(STATED) <= set(HEADER.values())


BLOCKS = [name for name in HEADER.blocks if name not in (*PROCESSOR, *STATED)]


@pytest.mark.parametrize("name", BLOCKS)
def test_where_a_peripheral_is(name: str) -> None:
    assert HEADER.values()[name] == CHIP.address(PERIPHERAL.get(name, name))


@pytest.mark.parametrize("name", [n for n in BLOCKS if HEADER.members(HEADER.blocks[n]) and n != "FDCANRAM1"])
def test_where_its_registers_are(name: str) -> None:
    kind = HEADER.blocks[name]
    # A timer with fewer registers has the others reserved: the fullest of them stands for all.
    described = "TIM2" if kind == "tim_regs_t" else PERIPHERAL.get(name, name)
    for member in HEADER.members(kind):
        offset, _ = CHIP.register(described, register_path(described, member))
        assert HEADER.values()[f"{kind}.{member}"] == offset, f"{name}->{member}"


def test_where_the_registers_of_a_channel_are() -> None:
    start, _ = CHIP.register("DMA1", "ch[0]")
    for member in HEADER.members("dma_channel_regs_t"):
        offset, _ = CHIP.register("DMA1", f"ch[0].{member.lower()}")
        assert HEADER.values()[f"dma_channel_regs_t.{member}"] == offset - start


def test_the_layout_of_the_message_memory() -> None:
    """RM0440, FDCAN message RAM: 28 filters, 8 of two words, three FIFOs; 212 words for each controller."""
    told = HEADER.values()
    starts = {"FILTER[1]": 0x004, "EXTENDED_FILTER[1]": 0x074, "RX0[1]": 0x0B0 + 72, "RX1[1]": 0x188 + 72,
              "TX_EVENT[1]": 0x264, "TX[1]": 0x278 + 72}  # fmt: skip
    assert {name: told[f"fdcan_ram_t.{name}"] for name in starts} == starts


def test_every_interrupt_has_its_number() -> None:
    numbers = {n: int(v) for n, v in re.findall(r"IRQ_(\w+) = (\d+)", SOURCES["irq.h"])}
    described = CHIP.description("INTERRUPTS")
    assert numbers.pop("COUNT") == max(described.values()) + 1
    assert len(numbers) == 6
    assert numbers == {name: described[name] for name in numbers}
    table = re.findall(r"\[(?:IRQ_(\w+)|(\d+) \.\.\. (\d+))\] = (\w+)", SOURCES["vectors.c"])
    named = {name for name, _, _, _ in table if name}
    assert named == set(numbers)
    spans = [(int(first), int(last)) for name, first, last, _ in table if not name and int(last) > 8]
    covered = {n for first, last in spans for n in range(first, last + 1)} | set(numbers.values())
    assert covered == set(range(max(described.values()) + 1))


def test_every_pin_has_the_alternate_function_of_its_signal() -> None:
    text = "\n".join(SOURCES.values())
    told = {name: int(value) for name, value in re.findall(r"\bAF_(\w+)\s*=?\s*(\d+)u?\b", text)}
    for signal, (peripheral, channel) in SIGNALS.items():
        rows = CHIP.description("PERIPHERALS")[peripheral]["pins"]
        functions = {row["pin"]: row["af"] for row in rows if row["signal"] == channel}
        assert functions[PINS[signal]] == told[peripheral], (signal, PINS[signal])
    calls = re.findall(r"pin_alternate\(BOARD_(\w+), AF_(\w+),", text)
    assert dict(calls) == {signal: peripheral for signal, (peripheral, _) in SIGNALS.items()}


@pytest.mark.parametrize(("axis", "converter"), [("X", "ADC1"), ("Y", "ADC2")])
def test_the_accelerometer_is_on_the_channel_of_its_pin(axis: str, converter: str) -> None:
    channel = re.search(rf"BOARD_ADC_{axis}_CHANNEL (\d+)u", BOARD)
    assert channel is not None
    rows = CHIP.description("PERIPHERALS")[converter]["pins"]
    assert (PINS[f"ACCEL_{axis}"], f"IN{channel[1]}") in {(row["pin"], row["signal"]) for row in rows}


@pytest.mark.parametrize(
    ("source", "name", "peripheral", "signal"),
    [
        ("converters.c", "ADC1", "ADC1", "ADC1"),
        ("converters.c", "TIM2_C3", "TIM2", "CH3"),
        ("converters.c", "TIM5_C3", "TIM5", "CH3"),
        ("serial_line.h", "RX", "USART2", "RX"),
        ("serial_line.h", "TX", "USART2", "TX"),
    ],
)
def test_every_request_has_its_number(source: str, name: str, peripheral: str, signal: str) -> None:
    number = re.search(rf"REQUEST_{name}\s+(\d+)u", SOURCES[source])
    assert number is not None
    rows = CHIP.description("PERIPHERALS")[peripheral]["dma_channels"]
    assert {row["request"] for row in rows if row["signal"] == signal} == {int(number[1])}


def test_settings_and_slots_lie_on_pages_of_their_own() -> None:
    """The description's second layout: two banks, 64 bits at a time."""
    regions = re.findall(
        r'name: "BANK_(\d)",\s+kind: MemoryRegionKind::Flash,\s+address: (0x[0-9a-f]+),\s+size: (\d+),'
        r".*?erase_size: (\d+),\s+write_size: (\d+)",
        CHIP.metadata(), re.DOTALL,
    )  # fmt: skip
    banks = {int(n): (int(at, 16), int(size)) for n, at, size, erase, _ in regions if erase == "2048"}
    assert {int(write) for *_, write in regions} == {8}
    flash, slots = SOURCES["flash.c"], SOURCES["slots.h"]

    def number(name: str, text: str) -> int:
        found = re.search(rf"{name}\s+(\w+?)u\b", text)
        assert found is not None, name
        return int(found[1], 0)

    page = number("PAGE_BYTES", flash)
    assert number("BANK_PAGES", flash) * page == banks[1][1]
    assert number("FIRST_ADDRESS", flash) == banks[1][0] + number("FIRST_PAGE", flash) * page
    pages = re.search(r"SLOT_PAGE\(slot\) \(\(slot\) == 0u \? (\d+)u : (\d+)u\)", slots)
    assert pages is not None
    assert number("SLOT_0_BASE", slots) == banks[1][0] + int(pages[1]) * page
    assert int(pages[2]) == number("BANK_PAGES", flash)
    assert number("SLOT_1_BASE", slots) == banks[2][0]
    behind_settings = number("FIRST_PAGE", flash) + 2 * number("SECTOR_PAGES", flash)
    assert behind_settings <= int(pages[1])
    assert number("SLOT_PAGES", slots) * page == 65536


def test_the_pins_of_the_table_are_those_of_the_package_and_the_dac_is_not_5_v_tolerant() -> None:
    text = (HEADER.port / "io_structure.csv").read_text(encoding="utf-8")
    rows = list(csv.DictReader(line for line in text.splitlines() if not line.startswith("#")))
    assert {row["pin"] for row in rows} == CHIP.description("PINS")
    outputs = {
        row["pin"]
        for name, entry in CHIP.description("PERIPHERALS").items()
        if name.startswith("DAC")
        for row in entry["pins"]
    }
    tolerant = {row["pin"] for row in rows if row["structure"].startswith("FT")}
    assert outputs
    assert not outputs & tolerant


def test_a_pin_that_stands_3_v_only_is_an_analogue_one() -> None:
    """No package says which pin stands 5 V: this is what the description can say about that column.

    PA8 is the one output of an amplifier that the data sheet has as 5 V tolerant.
    """
    text = (HEADER.port / "io_structure.csv").read_text(encoding="utf-8")
    rows = list(csv.DictReader(line for line in text.splitlines() if not line.startswith("#")))
    analogue: dict[str, set[str]] = {}
    for name, entry in CHIP.description("PERIPHERALS").items():
        for row in entry["pins"]:
            if row["af"] is None:
                analogue.setdefault(row["pin"], set()).add(re.sub(r"\d+$", "", name))
    low = {row["pin"] for row in rows if row["structure"] == "TT"}
    assert all(analogue.get(pin, set()) & {"ADC", "COMP", "DAC", "OPAMP"} for pin in low)
    amplifiers = {pin for pin, names in analogue.items() if "OPAMP" in names}
    assert amplifiers - low == {"PA8"}
