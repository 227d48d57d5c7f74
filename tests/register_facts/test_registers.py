"""Every address, offset, mask and code of registers.h against the public description of the chip.

A macro that is named as its field (`USART_CR1_UE`) is looked up by that name. The others are spelled out as
PERIPHERAL.register.field=value, where the value is the description's own name for it, `mask`, `position` or
a number.
"""

import re

import pytest

from tests.register_facts import chip, header

PERIPHERAL = {
    "FLASH": "FLASH", "PWR": "PWR", "RCC": "RCC", "DMA": "DMA1", "DMA1": "DMA1", "DMA2": "DMA2",
    "ADC": "ADC1", "ADC_COMMON": "ADC123_COMMON", "TIM": "TIM2", "TIM1": "TIM1", "IWDG": "IWDG",
    "USART": "USART2", "CAN": "CAN1", "SPI": "SPI2", "UNIQUE_ID": "UID",
}  # fmt: skip
# Registers whose name in the manual differs from that of the description.
REGISTER = {
    "PWR.CR": "cr1", "PWR.CSR": "csr1", "CAN1.RF0R": "rfr[0]", "CAN1.RF1R": "rfr[1]", "CAN1.TX[1]": "tx[1]",
    "CAN1.RX[1]": "rx[1]", "CAN1.F[1]": "fb[1]", "DMA.CR": "st[0].cr", "DMA1.S[1]": "st[1]",
    "DMA1.LISR": "isr[0]", "DMA1.HISR": "isr[1]", "DMA1.LIFCR": "ifcr[0]", "DMA1.HIFCR": "ifcr[1]",
    "TIM2.CCMR1": "ccmr_input[0]",
    "TIM2.CCMR2": "ccmr_input[1]", "GPIOA.AFR[1]": "afr[1]", "ADC1.JOFR[1]": "jofr[1]",
    "ADC1.JDR[1]": "jdr[1]",
    "TIM1.CCMR1": "ccmr_output[0]", "TIM1.CCMR2": "ccmr_output[1]",
    **{f"{timer}.CCR{n}": f"ccr[{n - 1}]" for timer in ("TIM1", "TIM2") for n in (1, 2, 3, 4)},
}  # fmt: skip
FLAGS = ("feif", "dmeif", "teif", "htif", "tcif")
SPELLED: dict[str, str | list[str | int]] = {
    "FLASH_ACR_LATENCY_2": "FLASH.acr.latency=WS2",
    "FLASH_ACR_LATENCY_Msk": "FLASH.acr.latency=mask",
    # The description leaves RDERR out, bit 8 (RM0390 3.8.4).
    "FLASH_SR_ERRORS": [
        0x100,
        *(f"FLASH.sr.{e}=1" for e in ("operr", "wrperr", "pgaerr", "pgperr", "pgserr")),
    ],
    "FLASH_CR_SNB_Pos": "FLASH.cr.snb=position",
    "FLASH_CR_PSIZE_X32": "FLASH.cr.psize=PSIZE32",
    "PWR_CR_VOS_Msk": "PWR.cr1.vos=mask",
    "PWR_CR_VOS_3": "PWR.cr1.vos=SCALE3",
    "RCC_PLLCFGR_N_Pos": "RCC.pllcfgr.plln=position",
    "RCC_PLLCFGR_P_4": "RCC.pllcfgr.pllp=DIV4",
    "RCC_PLLCFGR_SRC_HSE": "RCC.pllcfgr.pllsrc=HSE",
    "RCC_PLLCFGR_Q_8": "RCC.pllcfgr.pllq=DIV8",
    "RCC_PLLCFGR_R_2": "RCC.pllcfgr.pllr=DIV2",
    "RCC_CFGR_SW_PLL": "RCC.cfgr.sw=PLL1_P",
    "RCC_CFGR_SWS_Msk": "RCC.cfgr.sws=mask",
    "RCC_CFGR_SWS_PLL": "RCC.cfgr.sws=PLL1_P",
    "RCC_CFGR_PPRE1_2": "RCC.cfgr.ppre1=DIV2",
    "RCC_CFGR_RTCPRE_Pos": "RCC.cfgr.rtcpre=position",
    "RCC_CSR_PINRSTF": "RCC.csr.padrstf=1",
    "RCC_CSR_IWDGRSTF": "RCC.csr.wdgrstf=1",
    "DMA_CR_FROM_MEMORY": "DMA1.st[0].cr.dir=MEMORY_TO_PERIPHERAL",
    "DMA_CR_WORDS": ["DMA1.st[0].cr.psize=BITS32", "DMA1.st[0].cr.msize=BITS32"],
    "DMA_CR_VERY_HIGH": "DMA1.st[0].cr.pl=VERY_HIGH",
    "DMA_CR_CHANNEL(0)": "DMA1.st[0].cr.chsel=0",
    "DMA_CR_CHANNEL(1)": "DMA1.st[0].cr.chsel=1",
    "DMA_STREAM0_FLAGS": [f"DMA2.isr[0].{flag}[0]=1" for flag in FLAGS],
    "DMA_STREAM0_TEIF": "DMA2.isr[0].teif[0]=1",
    "DMA_STREAM6_FLAGS": [f"DMA1.ifcr[1].{flag}[2]=1" for flag in FLAGS],
    "DMA1_LOW_TEIFS": ["DMA1.isr[0].teif[0]=1", "DMA1.isr[0].teif[1]=1"],
    "DMA1_HIGH_TEIFS": ["DMA1.isr[1].teif[1]=1", "DMA1.isr[1].teif[2]=1"],
    "ADC_CR2_EXTEN_RISING": "ADC1.cr2.exten=RISING_EDGE",
    "ADC_SMP_15_CYCLES": "ADC1.smpr1.smp[0]=CYCLES15",
    "ADC_SMP_480_CYCLES": "ADC1.smpr1.smp[0]=CYCLES480",
    "ADC_CCR_DUAL": "ADC123_COMMON.ccr.multi=DUAL_RJ",
    "ADC_CCR_DDS": "ADC123_COMMON.ccr.dds=1",
    "ADC_CCR_DMA_MODE_2": "ADC123_COMMON.ccr.dma=MODE2",
    "ADC_CCR_PCLK2_BY_4": "ADC123_COMMON.ccr.adcpre=DIV4",
    "ADC_CCR_TSVREFE": "ADC123_COMMON.ccr.tsvrefe=1",
    "ADC_JSQR_ONE(0)": "ADC1.jsqr.jsq[3]=0",
    "ADC_JSQR_ONE(1)": "ADC1.jsqr.jsq[3]=1",
    "TIM_CR2_MMS_UPDATE": "TIM2.cr2.mms=UPDATE",
    "TIM_SMCR_SMS_ENCODER": "TIM2.smcr.sms=ENCODER_MODE_3",
    "TIM_SMCR_SMS_TRIGGER": "TIM2.smcr.sms=TRIGGER_MODE",
    "TIM_SMCR_SMS_EXTERNAL_1": "TIM12.smcr.sms=EXT_CLOCK_MODE",
    "TIM_SMCR_TS_ITR(0)": "TIM2.smcr.ts=ITR0",
    "TIM_SMCR_TS_ITR(1)": "TIM2.smcr.ts=ITR1",
    "TIM_DIER_CC3DE": "TIM2.dier.ccde[2]=1",
    "TIM_SR_CC1IF": "TIM4.sr.ccif[0]=1",
    "TIM_SR_CC1OF": "TIM4.sr.ccof[0]=1",
    # The description names the code 01 after channel 4's own input.
    "TIM_CCMR1_CC1S_TI1": "TIM2.ccmr_input[0].ccs[0]=TI4",
    "TIM_CCMR1_IC1PSC_8": "TIM2.ccmr_input[0].icpsc[0]=3",
    "TIM_CCMR1_OC1M_TOGGLE": "TIM2.ccmr_output[0].ocm[0]=TOGGLE",
    "TIM_CCMR1_OC1M_FORCE_LOW": "TIM2.ccmr_output[0].ocm[0]=FORCE_INACTIVE",
    "TIM_CCMR1_IC1F(0)": "TIM2.ccmr_input[0].icf[0]=NO_FILTER",
    "TIM_CCMR1_IC1F(1)": "TIM2.ccmr_input[0].icf[0]=FCK_INT_N2",
    "TIM_CCMR1_CC2S_TI2": "TIM2.ccmr_input[0].ccs[1]=TI4",
    "TIM_CCMR1_IC2F(0)": "TIM2.ccmr_input[0].icf[1]=NO_FILTER",
    "TIM_CCMR1_IC2F(1)": "TIM2.ccmr_input[0].icf[1]=FCK_INT_N2",
    "TIM_CCMR2_CC3S_TRC": "TIM2.ccmr_input[1].ccs[0]=TRC",
    "TIM_CCER_CC1E": "TIM2.ccer.cce[0]=1",
    "TIM_CCER_CC3E": "TIM2.ccer.cce[2]=1",
    "TIM1_CCMR1_OC2M_PWM2": "TIM1.ccmr_output[0].ocm[1]=PWM_MODE2",
    "TIM1_CCER_CC2E": "TIM1.ccer.cce[1]=1",
    "SPI_CR1_BR_8": "SPI2.cr1.br=DIV8",
    "IWDG_KR_UNLOCK": "IWDG.kr.key=ENABLE",
    "IWDG_KR_REFRESH": "IWDG.kr.key=RESET",
    "IWDG_KR_START": "IWDG.kr.key=START",
    "IWDG_PR_32": "IWDG.pr.pr=DIVIDE_BY32",
    "USART_SR_ERRORS": [f"USART2.sr.{flag}=1" for flag in ("fe", "ne", "ore")],
    "CAN_TSR_RQCP": [f"CAN1.tsr.rqcp[{n}]=1" for n in range(3)],
    "CAN_TSR_TME(0)": "CAN1.tsr.tme[0]=1",
    "CAN_TSR_TME(1)": "CAN1.tsr.tme[1]=1",
    "CAN_TSR_TME_Msk": [f"CAN1.tsr.tme[{n}]=1" for n in range(3)],
    "CAN_RF0R_FMP_Msk": "CAN1.rfr[0].fmp=mask",
    "CAN_IER_FMPIE0": "CAN1.ier.fmpie[0]=1",
    "CAN_ESR_TEC_Pos": "CAN1.esr.tec=position",
    "CAN_ESR_REC_Pos": "CAN1.esr.rec=position",
    "CAN_TIR_TXRQ": "CAN1.tx[0].tir.txrq=1",
    "CAN_TIR_STID_Pos": "CAN1.tx[0].tir.stid=position",
    "CAN_RIR_STID_Pos": "CAN1.rx[0].rir.stid=position",
    "CAN_RDTR_DLC_Msk": "CAN1.rx[0].rdtr.dlc=mask",
}
# What the description does not hold, with the place that says it.
STATED = {
    "FLASH_KEY1": 0x45670123,  # RM0390 3.5.2
    "FLASH_KEY2": 0xCDEF89AB,
    "ADC_VREFINT_CHANNEL": 17,  # RM0390 13.10
    "ADC_CR2_EXTSEL_TIM3": 8 << 24,  # RM0390 13.13.3: 1000, timer 3 TRGO; the field is looked up below
    "TIM11_OR_TI1_HSE_RTC": 2,  # RM0390 18.5.11: TI1_RMP 10; the register has no fields there
    "SCB_CFSR_MMARVALID": 1 << 7,  # Armv7-M architecture, B3.2.15
    "SCB_CFSR_BFARVALID": 1 << 15,
    "SCB_ICSR_VECTACTIVE": 0x1FF,  # B3.2.4
    "NVIC_IPR": 0xE000E400,  # B3.4.9
    "VREFINT_CAL": 0x1FFF7A2A,  # data sheet, internal reference voltage calibration values
}
PROCESSOR = ("SCB", "NVIC_ISER", "SCB_AIRCR_RESET")
RCC_ENABLE = re.compile(r"RCC_(A[HP]B\dENR)_(\w+)")


bits = chip.F446.bits


def register_path(peripheral: str, name: str) -> str:
    return REGISTER.get(f"{peripheral}.{name}", name.lower())


def by_name(macro: str) -> int:
    """USART_CR1_UE: bit `ue` of `cr1`; the enables of the clock are named after the peripheral."""
    if enable := RCC_ENABLE.fullmatch(macro):
        return bits(f"RCC.{enable[1].lower()}.{enable[2].lower()}en=1")
    prefix, name, field = macro.split("_")
    peripheral = PERIPHERAL[prefix]
    if prefix == "DMA":
        return bits(f"{peripheral}.st[0].{name.lower()}.{field.lower()}=1")
    return bits(f"{peripheral}.{register_path(peripheral, name)}.{field.lower()}=1")


def constants() -> list[str]:
    return [n for n in header.values() if "." not in n and (n not in header.BLOCKS or n in STATED)]


@pytest.mark.parametrize("macro", [m for m in constants() if m not in PROCESSOR])
def test_the_bits_of_a_macro(macro: str) -> None:
    told = header.values()[macro]
    if macro in STATED:
        assert told == STATED[macro]
        return
    spelled = SPELLED.get(macro)
    if spelled is None:
        assert told == by_name(macro)
    else:
        assert told == sum(map(bits, [spelled] if isinstance(spelled, str) else spelled))


def test_nothing_is_spelled_that_is_not_there() -> None:
    assert set(SPELLED) | set(STATED) <= set(header.values())


BLOCKS = [name for name in header.BLOCKS if name not in (*PROCESSOR, *STATED)]


@pytest.mark.parametrize("name", BLOCKS)
def test_where_a_peripheral_is(name: str) -> None:
    assert header.values()[name] == chip.address(PERIPHERAL.get(name, name))


@pytest.mark.parametrize("name", [name for name in BLOCKS if header.members(header.BLOCKS[name])])
def test_where_its_registers_are(name: str) -> None:
    kind = header.BLOCKS[name]
    described = PERIPHERAL.get(name, name)
    # A timer with fewer registers has the others reserved: the fullest of them stands for all.
    described = "TIM2" if kind == "tim_regs_t" else "DMA1" if kind == "dma_regs_t" else described
    described = "GPIOA" if kind == "gpio_regs_t" else "ADC1" if kind == "adc_regs_t" else described
    for member in header.members(kind):
        offset, _ = chip.register(described, register_path(described, member))
        assert header.values()[f"{kind}.{member}"] == offset, f"{name}->{member}"


@pytest.mark.parametrize(
    ("kind", "peripheral", "block"),
    [
        ("dma_stream_regs_t", "DMA1", "st[0]"),
        ("can_tx_regs_t", "CAN1", "tx[0]"),
        ("can_rx_regs_t", "CAN1", "rx[0]"),
    ],
)
def test_where_the_registers_of_a_stream_or_mailbox_are(kind: str, peripheral: str, block: str) -> None:
    start, _ = chip.register(peripheral, block)
    for member in header.members(kind):
        offset, _ = chip.register(peripheral, f"{block}.{member.lower()}")
        assert header.values()[f"{kind}.{member}"] == offset - start


def test_the_external_trigger_field_is_where_the_code_is_put() -> None:
    position, width, _ = chip.field("ADC1", "cr2", "extsel")
    assert header.values()["ADC_CR2_EXTSEL_TIM3"] >> position == 8
    assert 1 << width > 8


def test_the_processor_s_own_registers() -> None:
    """The crate cortex-m: SCB without its first word (CPUID), and NVIC."""
    source = chip.crate("cortex-m") / "peripheral"
    places = dict(
        re.findall(
            r"PTR: \*const (?:self::)?(scb|nvic|cpuid)::RegisterBlock = (0x[0-9A-F_]+)",
            "\n".join(reversed((source / "mod.rs").read_text().splitlines())),
        )
    )
    scb, nvic, cpuid = (int(places[name].replace("_", ""), 16) for name in ("scb", "nvic", "cpuid"))
    assert header.values()["SCB"] == cpuid == scb - 4
    assert header.values()["NVIC_ISER"] == nvic
    text = (source / "scb.rs").read_text()
    block = text.split("pub struct RegisterBlock")[1].split("\n}")[0]
    names = [n.upper() for n in re.findall(r"pub (\w+): RW<u32>", block)]
    names = names[: names.index("BFAR") + 1]
    offset = 4
    for name in names:
        offset += 12 if name == "SHCSR" else 0  # SHPR, three words
        assert header.values()[f"scb_regs_t.{name}"] == offset, name
        offset += 4
    key, request = (
        re.search(rf"const {name}: u32 = (\w+) << (\d+);", text)
        for name in ("SCB_AIRCR_VECTKEY", "SCB_AIRCR_SYSRESETREQ")
    )
    assert key is not None
    assert request is not None
    reset = int(key[1], 0) << int(key[2]) | int(request[1]) << int(request[2])
    assert header.values()["SCB_AIRCR_RESET"] == reset
