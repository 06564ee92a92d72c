@ The main loop looks at P0.3; a level other than the last one is counted in RAM and toggles P0.10.
        ldr     r0, =0x3FFFC000         @ fast GPIO
        mov     r1, #0x400
        str     r1, [r0]                @ P0.10 is an output
        mov     r5, #0x40000000
        mov     r6, #0
        mov     r7, #0
loop:   ldr     r2, [r0, #0x14]
        and     r2, r2, #8
        cmp     r2, r7
        beq     loop
        mov     r7, r2
        add     r6, r6, #1
        str     r6, [r5]
        tst     r6, #1
        strne   r1, [r0, #0x18]
        streq   r1, [r0, #0x1C]
        b       loop
