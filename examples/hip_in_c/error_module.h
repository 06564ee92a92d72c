/* Errors of this board: noted anywhere, collected once per slot, sent one at a time. */
#ifndef ERROR_MODULE_H
#define ERROR_MODULE_H

#include <ranger_sim/firmware.h>

/* Note an error by its code (ranger_errors.h); from any task or handler. */
void error_report(uint32_t code);
/* Task of every slot: what was noted goes into the ring. Returns how many codes there were. */
int32_t error_update(void);
/* The error that waits longest: its word (code, board, count) and when it came first. 0 when none waits. */
int error_take(uint32_t *word, uint32_t *stamp);
/* Events of each code since power-up. */
const fw_error_counts *error_counts(void);

#endif
