/* Registers of the LPC2194/01 that firmware.c uses, by the names of its user manual. */
#ifndef CHIP_REGISTERS_H
#define CHIP_REGISTERS_H

#include <stdint.h>

#define REGISTER(address) (*(volatile uint32_t *)(address))

/* Timers 0 and 1 */
#define TIMER(number) (0xE0004000u + 0x4000u * (number))
#define TxIR(n) REGISTER(TIMER(n) + 0x00)
#define TxTCR(n) REGISTER(TIMER(n) + 0x04)
#define TxTC(n) REGISTER(TIMER(n) + 0x08)
#define TxPR(n) REGISTER(TIMER(n) + 0x0C)
#define TxMCR(n) REGISTER(TIMER(n) + 0x14)
#define TxMR0(n) REGISTER(TIMER(n) + 0x18)
#define TxCCR(n) REGISTER(TIMER(n) + 0x28)
#define TxCR(n, channel) REGISTER(TIMER(n) + 0x2C + 4u * (channel))
#define TCR_ENABLE 1u
#define TCR_RESET 2u
#define MCR_MR0_INTERRUPT 1u
#define MCR_MR0_RESET 2u

/* UARTs 0 and 1 */
#define UART(number) (0xE000C000u + 0x4000u * (number))
#define UxRBR(n) REGISTER(UART(n) + 0x00)
#define UxTHR(n) REGISTER(UART(n) + 0x00)
#define UxDLL(n) REGISTER(UART(n) + 0x00)
#define UxDLM(n) REGISTER(UART(n) + 0x04)
#define UxIER(n) REGISTER(UART(n) + 0x04)
#define UxIIR(n) REGISTER(UART(n) + 0x08)
#define UxFCR(n) REGISTER(UART(n) + 0x08)
#define UxLCR(n) REGISTER(UART(n) + 0x0C)
#define UxLSR(n) REGISTER(UART(n) + 0x14)
#define UxFDR(n) REGISTER(UART(n) + 0x28)
#define LCR_8N1 0x03u
#define LCR_DIVISOR 0x80u
#define LSR_THRE 0x20u
#define FCR_ENABLE 0x07u /* and both FIFOs emptied */
#define IER_RBR 0x01u
#define IER_THRE 0x02u
#define UART_FIFO 16u

/* PWM */
#define PWMTCR REGISTER(0xE0014004u)
#define PWMPR REGISTER(0xE001400Cu)
#define PWMMCR REGISTER(0xE0014014u)
#define PWMMR(match) REGISTER((match) < 4u ? 0xE0014018u + 4u * (match) : 0xE0014030u + 4u * (match))
#define PWMPCR REGISTER(0xE001404Cu)
#define PWMLER REGISTER(0xE0014050u)
#define PWMTCR_ON 0x09u /* counts, in PWM mode */
#define PWMMCR_MR0_RESET 0x02u
#define PWMPCR_OUTPUT(match) (0x100u << (match))

/* SPI 0 */
#define S0SPCR REGISTER(0xE0020000u)
#define S0SPSR REGISTER(0xE0020004u)
#define S0SPDR REGISTER(0xE0020008u)
#define S0SPCCR REGISTER(0xE002000Cu)
#define S0SPINT REGISTER(0xE002001Cu)
#define SPSR_SPIF 0x80u

/* Pins */
#define PINSEL(word) REGISTER(0xE002C000u + 4u * (word))
#define FIODIR(port) REGISTER(0x3FFFC000u + 0x20u * (port))
#define FIOPIN(port) REGISTER(0x3FFFC014u + 0x20u * (port))
#define FIOSET(port) REGISTER(0x3FFFC018u + 0x20u * (port))
#define FIOCLR(port) REGISTER(0x3FFFC01Cu + 0x20u * (port))

/* A/D converter */
#define ADCR REGISTER(0xE0034000u)
#define ADGDR REGISTER(0xE0034004u)
#define ADINTEN REGISTER(0xE003400Cu)
#define ADDR(channel) REGISTER(0xE0034010u + 4u * (channel))
#define ADCR_BURST 0x10000u
#define ADCR_PDN 0x200000u
#define ADCR_START 0x1000000u
#define ADGDR_DONE 0x80000000u

/* CAN: acceptance filter, controllers 1 ... 4 */
#define AFMR REGISTER(0xE003C000u)
#define AFMR_OFF 1u
#define AFMR_BYPASS 2u
#define SFF_sa REGISTER(0xE003C004u)
#define SFF_GRP_sa REGISTER(0xE003C008u)
#define EFF_sa REGISTER(0xE003C00Cu)
#define EFF_GRP_sa REGISTER(0xE003C010u)
#define ENDofTable REGISTER(0xE003C014u)
#define AFRAM(offset) REGISTER(0xE0038000u + (offset)) /* the lookup table */
#define AFRAM_BYTES 2048u
#define CAN(controller) (0xE0040000u + 0x4000u * (controller))
#define CxMOD(n) REGISTER(CAN(n) + 0x00)
#define CxCMR(n) REGISTER(CAN(n) + 0x04)
#define CxGSR(n) REGISTER(CAN(n) + 0x08)
#define CxICR(n) REGISTER(CAN(n) + 0x0C)
#define CxIER(n) REGISTER(CAN(n) + 0x10)
#define CxBTR(n) REGISTER(CAN(n) + 0x14)
#define CxSR(n) REGISTER(CAN(n) + 0x1C)
#define CxRFS(n) REGISTER(CAN(n) + 0x20)
#define CxRID(n) REGISTER(CAN(n) + 0x24)
#define CxRDA(n) REGISTER(CAN(n) + 0x28)
#define CxRDB(n) REGISTER(CAN(n) + 0x2C)
#define CxTFI(n, buffer) REGISTER(CAN(n) + 0x20 + 0x10u * (buffer))
#define CxTID(n, buffer) REGISTER(CAN(n) + 0x24 + 0x10u * (buffer))
#define CxTDA(n, buffer) REGISTER(CAN(n) + 0x28 + 0x10u * (buffer))
#define CxTDB(n, buffer) REGISTER(CAN(n) + 0x2C + 0x10u * (buffer))
#define CMR_TR 0x01u
#define CMR_AT 0x02u
#define CMR_RRB 0x04u
#define CMR_CDO 0x08u
#define CMR_STB(buffer) (0x10u << (buffer))
#define SR_TBS(buffer) (0x04u << 8u * ((buffer) - 1u))
#define RFS_BY_FILTER 0x000007FFu /* which entry of the filter it was, and that it was bypassed */

/* SSP */
#define SSPCR0 REGISTER(0xE005C000u)
#define SSPCR1 REGISTER(0xE005C004u)
#define SSPDR REGISTER(0xE005C008u)
#define SSPSR REGISTER(0xE005C00Cu)
#define SSPCPSR REGISTER(0xE005C010u)
#define SSPSR_RNE 0x04u
#define SSPSR_BSY 0x10u

/* System control */
#define PCON REGISTER(0xE01FC0C0u)
#define PCON_IDLE 1u
#define EXTINT REGISTER(0xE01FC140u)
#define EXTMODE REGISTER(0xE01FC148u)
#define EXTPOLAR REGISTER(0xE01FC14Cu)
#define SCS REGISTER(0xE01FC1A0u)
#define SCS_FAST_GPIO 3u

/* VIC */
#define VICFIQStatus REGISTER(0xFFFFF004u)
#define VICIntSelect REGISTER(0xFFFFF00Cu)
#define VICIntEnable REGISTER(0xFFFFF010u)
#define VICIntEnClr REGISTER(0xFFFFF014u)
#define VICSoftInt REGISTER(0xFFFFF018u)
#define VICSoftIntClear REGISTER(0xFFFFF01Cu)
#define VICDefVectAddr REGISTER(0xFFFFF034u)
#define VICVectAddrOf(slot) REGISTER(0xFFFFF100u + 4u * (slot))
#define VICVectCntl(slot) REGISTER(0xFFFFF200u + 4u * (slot))
#define VICVectCntl_ENABLED 0x20u

/* Inputs of the VIC */
#define INPUT_SOFTWARE 1u
#define INPUT_TIMER(number) (4u + (number))
#define INPUT_UART(number) (6u + (number))
#define INPUT_SPI0 10u
#define INPUT_EINT(number) (14u + (number))
#define INPUT_ADC 18u
#define INPUT_CAN_ERRORS 19u
#define INPUT_CAN_TX(controller) (19u + (controller))
#define INPUT_CAN_RX(controller) (25u + (controller))

#endif
