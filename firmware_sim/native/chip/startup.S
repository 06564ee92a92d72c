/* From reset to firmware_start: clocks as the robot's boards have them, stacks, memory; and the ways into interrupts. */

#define MODE_FIQ 0x11
#define MODE_IRQ 0x12
#define MODE_SVC 0x13
#define MODE_SYS 0x1F
#define NO_IRQ 0x80
#define NO_FIQ 0x40

#define SYSTEM_CONTROL 0xE01FC000
#define MAMCR 0x000
#define MAMTIM 0x004
#define PLLCON 0x080
#define PLLCFG 0x084
#define PLLSTAT 0x088
#define PLLFEED 0x08C
#define VPBDIV 0x100
#define PLOCK 0x400

#define SLOT_TIMER 0xE0008000 /* timer 1; after reset it counts to the end of 32 bits */
#define TxTCR 0x004

#define VICVectAddr 0xFFFFF030

    .syntax divided
    .arm
    .section .vectors, "ax"
    .global chip_vectors
chip_vectors:
    ldr pc, reset_address
    ldr pc, undefined_address
    ldr pc, call_address
    ldr pc, prefetch_address
    ldr pc, data_address
    .word 0xB8A06F58 /* the sum of all eight is 0: the boot loader asks for it */
    ldr pc, irq_address
    ldr pc, fiq_address
reset_address:     .word chip_reset
undefined_address: .word chip_undefined_instruction
call_address:      .word chip_software_interrupt
prefetch_address:  .word chip_prefetch_abort
data_address:      .word chip_data_abort
    .word 0 /* the sixth has no address */
irq_address:       .word chip_irq
fiq_address:       .word chip_fiq

    .text
    .global chip_reset
    .type chip_reset, %function
chip_reset:
    /* 10 MHz crystal times 6: 60 MHz; the peripherals get the same; flash in four clocks, its accelerator on. The low
       four bits of PLLCFG are the factor less one, the next two make its oscillator's 240 MHz. */
    ldr r0, =SYSTEM_CONTROL
    mov r1, #0
    str r1, [r0, #MAMCR]
    mov r1, #4
    str r1, [r0, #MAMTIM]
    mov r1, #2
    str r1, [r0, #MAMCR]
    mov r2, #0xAA
    mov r3, #0x55
    mov r1, #0x25
    str r1, [r0, #PLLCFG]
    mov r1, #1
    str r1, [r0, #PLLCON]
    str r2, [r0, #PLLFEED]
    str r3, [r0, #PLLFEED]
1:  ldr r1, [r0, #PLLSTAT]
    tst r1, #PLOCK
    beq 1b
    mov r1, #3
    str r1, [r0, #PLLCON]
    str r2, [r0, #PLLFEED]
    str r3, [r0, #PLLFEED]
    mov r1, #1
    str r1, [r0, #VPBDIV]
    ldr r0, =SLOT_TIMER /* from here on time is counted */
    str r1, [r0, #TxTCR]

    /* A stack for each mode that runs. The program runs in system mode, so that it may hold back interrupts. */
    msr cpsr_c, #(MODE_FIQ | NO_IRQ | NO_FIQ)
    ldr sp, =chip_fiq_stack
    msr cpsr_c, #(MODE_IRQ | NO_IRQ | NO_FIQ)
    ldr sp, =chip_irq_stack
    msr cpsr_c, #(MODE_SVC | NO_IRQ | NO_FIQ)
    ldr sp, =chip_svc_stack
    msr cpsr_c, #(MODE_SYS | NO_IRQ | NO_FIQ)
    ldr sp, =chip_program_stack

    /* Initial values, zeros. */
    ldr r0, =chip_data
    ldr r1, =chip_data_end
    ldr r2, =chip_data_load
2:  cmp r0, r1
    ldrlo r3, [r2], #4
    strlo r3, [r0], #4
    blo 2b
    ldr r0, =chip_bss
    ldr r1, =chip_bss_end
    mov r2, #0
    mov r3, #0
    mov r4, #0
    mov r5, #0
3:  cmp r0, r1
    stmloia r0!, {r2-r5}
    blo 3b

    ldr r0, =chip_main
    mov lr, pc
    bx r0
4:  b 4b
    .size chip_reset, . - chip_reset

/* An interrupt of a vectored slot: VICVectAddr has the slot's line. Another one comes in only when it is over. */
    .global chip_irq
    .type chip_irq, %function
chip_irq:
    sub lr, lr, #4
    stmfd sp!, {r0-r3, r12, lr}
    ldr r1, =VICVectAddr
    ldr r0, [r1]
    ldr r2, =chip_serve
    mov lr, pc
    bx r2
    ldr r1, =VICVectAddr
    str r0, [r1]
    ldmfd sp!, {r0-r3, r12, pc}^
    .size chip_irq, . - chip_irq

/* The fast interrupt has registers 8 ... 14 of its own. */
    .global chip_fiq
    .type chip_fiq, %function
chip_fiq:
    sub lr, lr, #4
    stmfd sp!, {r0-r3, r12, lr}
    ldr r0, =chip_serve_fast
    mov lr, pc
    bx r0
    ldmfd sp!, {r0-r3, r12, pc}^
    .size chip_fiq, . - chip_fiq

/* Where a program ends that went wrong: a debugger sees which it is. The motor's watchdog starves. */
    .global chip_undefined_instruction, chip_software_interrupt, chip_prefetch_abort, chip_data_abort
chip_undefined_instruction: b chip_undefined_instruction
chip_software_interrupt:    b chip_software_interrupt
chip_prefetch_abort:        b chip_prefetch_abort
chip_data_abort:            b chip_data_abort
    .ltorg
