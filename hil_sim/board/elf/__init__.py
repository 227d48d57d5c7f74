"""The shipping binary in an emulated STM32F446RE."""
