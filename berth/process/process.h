/* The process image for a run-time system in another process, or in another language than C++: variables of a CANopen
 * device by their names, in memory that both share.
 *
 *     char why[200];
 *     berth_process *image = berth_process_open("belt", why, sizeof why);
 *     if (image == NULL) { puts(why); return 1; }
 *     berth_variable level, motor;
 *     if (!berth_process_find(image, "Silo level", &level)) ...
 *     for (;;) {                                    // once a cycle
 *       berth_process_refresh(image);
 *       if (berth_process_validity(image, &level) == BERTH_GOOD) ...
 *       berth_process_set_integer(image, &motor, berth_process_integer(image, &level) < 200);
 *       berth_process_commit(image);
 *     }
 *
 * Direction as the network sees it (paper 5 §2.1, Figure 2; CiA 302-4): an input variable is what the application
 * writes and a TPDO carries, an output variable is what an RPDO brings. Neither side ever waits for the other, and what
 * is read is of one instant (docs/process-image.md). A `berth_process` belongs to one thread. No function but `open`
 * and `close` uses the heap. The name's file is /dev/shm/berth-NAME; its owner alone may open it.
 *
 * Either process may end at any time, killed too, and be started anew. The application that comes back begins with all
 * inputs 0; until its first commit the network keeps what the one before committed, unless the device's
 * `application_timeout` has run out. When the network's process has ended, `berth_process_connected` says so: close,
 * and open again.
 */
#ifndef BERTH_PROCESS_H
#define BERTH_PROCESS_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum { BERTH_INPUT = 0, BERTH_OUTPUT = 1 } berth_direction;

/* Of an output variable. */
typedef enum {
  BERTH_WAITING = 0, /* not received since the device became operational: the value is its default, or an old one */
  BERTH_GOOD = 1,    /* received; how long ago says `berth_process_age_ns` */
  BERTH_SILENT = 2   /* the deadline of its RPDO (1400h:05) has passed: its producer is lost */
} berth_validity;

typedef struct {
  const char* name;  /* stays until `berth_process_close` */
  uint32_t offset;   /* bytes from the begin of its direction's part */
  uint32_t number;   /* among the variables of its direction, from 0 */
  uint16_t type;     /* index of the data type, CiA 301 §7.4.7: 0005h UNSIGNED8 */
  uint8_t size;      /* bytes: BOOLEAN 1, INTEGER24 3; little-endian */
  uint8_t direction; /* berth_direction */
} berth_variable;

/* One node, as the device or the manager knows it. */
typedef struct {
  uint8_t nmt_state;     /* CiA 301 table 36: 0 boot-up, 4 stopped, 5 operational, 127 pre-operational; 255 not known */
  uint8_t error_control; /* berth_error_control */
  uint8_t configuration; /* berth_configuration: a manager knows it */
  char boot;             /* letter of CiA 302-2 with which its boot-up ended, 'A' to 'Q'; 0: none, or it is fine */
  uint8_t error_register; /* of its last EMCY */
  uint8_t reserved;
  uint16_t emcy;       /* code of its last EMCY; 0000h: its errors are gone, or it has told none */
  uint32_t emcy_count; /* EMCY messages */
} berth_node_diagnosis;

typedef enum {
  BERTH_NOT_WATCHED = 0,
  BERTH_NOT_HEARD = 1, /* no heartbeat yet */
  BERTH_ALIVE = 2,
  BERTH_LOST = 3
} berth_error_control;

typedef enum {
  BERTH_CONFIGURATION_UNKNOWN = 0,
  BERTH_NO_DEVICE = 1,
  BERTH_CONFIGURING = 2, /* identified, configured or booted now */
  BERTH_CONFIGURED = 3,  /* by the manager, and in operation */
  BERTH_REFUSED = 4      /* a person has to do something: the manager's status says what */
} berth_configuration;

/* The diagnosis and error interface of paper 5 §4. */
typedef struct {
  uint8_t nmt_state;      /* of the device, or of the manager's own */
  uint8_t node_id;        /* 0: none */
  uint8_t error_register; /* 1001h */
  uint8_t bus_up;         /* 0: no cable, no interface, or not known */
  uint8_t bus_off;
  uint8_t error_passive;
  uint16_t reserved;
  uint16_t transmit_errors; /* the controller's error counters, where the port knows them */
  uint16_t receive_errors;
  uint32_t bus_errors; /* noticed so far, where the port knows them */
  uint32_t lost_frames;
  uint32_t reserved2;
  berth_node_diagnosis nodes[128]; /* by node-ID; 0 is not used */
} berth_diagnosis;

typedef struct berth_process berth_process;

/* NULL: `why` says what to do; the image is not there, is of another version, or another application has it. `why` may
 * be NULL. */
berth_process* berth_process_open(const char* name, char* why, size_t why_size);
void berth_process_close(berth_process* image);
/* 0: the process that has the device has ended, or has made the image anew. */
int berth_process_connected(const berth_process* image);

/* In the order in which they were declared. */
size_t berth_process_count(const berth_process* image);
int berth_process_at(const berth_process* image, size_t place, berth_variable* variable);
/* 0: there is none of that name, and `variable` is not touched. */
int berth_process_find(const berth_process* image, const char* name, berth_variable* variable);

/* 1: something newer has come. What is read, validities and diagnosis too, is of that instant until the next call. */
int berth_process_refresh(berth_process* image);
/* Any type; a REAL is cut. UNSIGNED64 above 2^63-1 comes as a negative number: its bits. Of an input variable: what was
 * set. */
int64_t berth_process_integer(const berth_process* image, const berth_variable* variable);
/* The same as a real number. */
double berth_process_real(const berth_process* image, const berth_variable* variable);
berth_validity berth_process_validity(const berth_process* image, const berth_variable* variable);
/* Since it was received last; -1: not since the device became operational. Counts on when the network is gone. */
int64_t berth_process_age_ns(const berth_process* image, const berth_variable* variable);
const berth_diagnosis* berth_process_diagnosis(const berth_process* image);

/* 0, and nothing is set: not an input variable, or a value that its type cannot hold. Integers take the nearest of a
 * real number. */
int berth_process_set_integer(berth_process* image, const berth_variable* variable, int64_t value);
int berth_process_set_real(berth_process* image, const berth_variable* variable, double value);
/* An error of the application's own: the device tells it as EMCY of that code (CiA 301 table 26; FF00h and above are
 * the maker's) and shows it in 1001h, until there is another or, with code 0, none. `error_register`: bits of 1001h,
 * bit 0 at least. With the next commit. */
void berth_process_set_error(berth_process* image, uint16_t code, uint8_t error_register);
/* Hands all inputs over, as they stand. Once a cycle also when nothing changed: it is the application's sign of life.
 */
void berth_process_commit(berth_process* image);

/* For a run-time system whose programs address the image itself (%I, %Q): the parts, `offset` in them. The outputs are
 * others after each `refresh`. */
const uint8_t* berth_process_outputs(const berth_process* image, size_t* size);
uint8_t* berth_process_inputs(berth_process* image, size_t* size);

#ifdef __cplusplus
}
#endif

#endif
