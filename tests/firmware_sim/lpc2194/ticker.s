@ A board of its own: a timer's interrupt every 100 us toggles P0.10 and sends a frame; the main loop waits for it.
        .equ    CAN1, 0xE0044000
        b       reset
        b       .
        b       .
        b       .
        b       .
        nop
        ldr     pc, [pc, #-0xFF0]       @ IRQ: VICVectAddr
        b       .                       @ FIQ
reset:  msr     cpsr_c, #0xD2           @ IRQ mode
        mov     sp, #0x40000000
        add     sp, sp, #0x1000
        msr     cpsr_c, #0xD3           @ supervisor mode
        mov     sp, #0x40000000
        add     sp, sp, #0x2000
        ldr     r0, =0xE01FC000         @ system control
        mov     r1, #0x25               @ 10 MHz to 60 MHz
        str     r1, [r0, #0x84]
        mov     r1, #1
        str     r1, [r0, #0x80]
        mov     r2, #0xAA
        mov     r3, #0x55
        str     r2, [r0, #0x8C]
        str     r3, [r0, #0x8C]
lock:   ldr     r4, [r0, #0x88]
        tst     r4, #0x400
        beq     lock
        mov     r1, #3
        str     r1, [r0, #0x80]
        str     r2, [r0, #0x8C]
        str     r3, [r0, #0x8C]
        mov     r1, #4
        str     r1, [r0, #4]            @ MAMTIM
        mov     r1, #2
        str     r1, [r0, #0]            @ MAMCR
        mov     r1, #1
        str     r1, [r0, #0x100]        @ VPBDIV
        ldr     r0, =0x3FFFC000         @ P0.10 is an output
        mov     r1, #0x400
        str     r1, [r0, #0]
        ldr     r0, =CAN1
        ldr     r1, =0x00254001         @ 3 Mbit/s
        str     r1, [r0, #0x14]
        mov     r1, #0
        str     r1, [r0, #0]            @ out of reset mode
        ldr     r0, =0xE0008000         @ timer 1: every 6000 counts
        ldr     r1, =5999
        str     r1, [r0, #0x18]
        mov     r1, #3
        str     r1, [r0, #0x14]
        ldr     r2, =0xFFFFF000         @ VIC: its interrupt in slot 4
        adr     r1, tick
        str     r1, [r2, #0x110]
        mov     r1, #0x25
        str     r1, [r2, #0x210]
        mov     r1, #0x20
        str     r1, [r2, #0x10]
        mov     r1, #1
        str     r1, [r0, #4]
        mov     r5, #0x40000000         @ a count of ticks, and of those that were served
        mov     r6, #0
        str     r6, [r5]
        msr     cpsr_c, #0x53           @ IRQ on
wait:   bl      look
        cmp     r0, r6
        beq     wait
        mov     r6, r0
        ldr     r1, =CAN1
        mov     r2, #0x00080000         @ eight bytes
        str     r2, [r1, #0x30]
        mov     r2, #14
        str     r2, [r1, #0x34]
        str     r6, [r1, #0x38]
        str     r6, [r1, #0x3C]
        mov     r2, #0x21               @ request buffer 1
        str     r2, [r1, #4]
        b       wait
look:   push    {r4, lr}
        mov     r4, r5
        ldr     r0, [r4]
        pop     {r4, pc}
tick:   sub     lr, lr, #4
        push    {r0, r1, r2, lr}
        ldr     r0, =0xE0008000
        mov     r1, #1
        str     r1, [r0]                @ the flag
        ldr     r1, [r5]
        add     r1, r1, #1
        str     r1, [r5]
        ldr     r0, =0x3FFFC000
        mov     r2, #0x400
        tst     r1, #1
        strne   r2, [r0, #0x18]
        streq   r2, [r0, #0x1C]
        ldr     r0, =0xFFFFF000
        str     r0, [r0, #0x30]         @ the interrupt is served
        ldmfd   sp!, {r0, r1, r2, pc}^
