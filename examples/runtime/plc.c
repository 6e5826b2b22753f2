/* A small soft PLC: the program of a belt of examples/conveyor (scripts/station.lua) in C, in a process of its own, with
 * a cycle of 5 ms. It knows nothing of CANopen: its variables have names, and come from the image that main.cpp offers.
 *
 *     example_runtime_plc IMAGE [SECONDS]
 */
#define _POSIX_C_SOURCE 200809L

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "berth/process/process.h"

enum { cycle_ms = 5, clear_ms = 8000, last_belt = 10, most_at_once = 5000, blocked_code = 0xFF01 };
enum state { IDLE, STARTING, RUNNING, BLOCKED };
enum { drive, belt, scale, panel }; /* the modules */

static volatile sig_atomic_t ended = 0;
static void end(int number) {
  (void)number;
  ended = 1;
}

/* ---- variables by name ---- */

struct program {
  berth_process *image;
  int number; /* of the belt: the node-ID */
  enum state state;
  int blocked_for;
  int beat_for;
  long long beat, starts, run_ms, grabbed, total, seen;
  int counted;
  double energy, flow;
};

static long long get(const struct program *p, const char *name) {
  berth_variable variable;
  return berth_process_find(p->image, name, &variable) ? berth_process_integer(p->image, &variable) : 0;
}

static int set(const struct program *p, const char *name, long long value) {
  berth_variable variable;
  return berth_process_find(p->image, name, &variable) && berth_process_set_integer(p->image, &variable, value);
}

static int set_real(const struct program *p, const char *name, double value) {
  berth_variable variable;
  return berth_process_find(p->image, name, &variable) && berth_process_set_real(p->image, &variable, value);
}

/* A variable that its producer tells no longer counts as this. */
static long long get_or(const struct program *p, const char *name, long long otherwise) {
  berth_variable variable;
  if (!berth_process_find(p->image, name, &variable)) return otherwise;
  if (berth_process_validity(p->image, &variable) != BERTH_GOOD) return otherwise;
  return berth_process_integer(p->image, &variable);
}

static const char *module_object(int index, int at) {
  static char name[16];
  snprintf(name, sizeof name, "%04Xh:%02X", (unsigned)index, (unsigned)at);
  return name;
}
static long long input_byte(const struct program *p, int module, int at) {
  return get(p, module_object(0x2100, module * 2 + at));
}
static long long input_word(const struct program *p, int module, int at) {
  return get(p, module_object(0x2101, module * 4 + at));
}
static void output_byte(const struct program *p, int module, int at, long long value) {
  set(p, module_object(0x2200, module * 2 + at), value);
}
static void output_word(const struct program *p, int module, int at, long long value) {
  set(p, module_object(0x2201, module * 2 + at), value);
}
static long long most(long long a, long long b) { return a > b ? a : b; }
static long long least(long long a, long long b) { return a < b ? a : b; }

/* ---- the program ---- */

static enum state next_state(struct program *p) {
  const int may_run = get_or(p, "run", 0) && (p->number == last_belt || get_or(p, "next_may_feed", 0));
  const int blocked = (input_byte(p, belt, 1) & 2) != 0;
  if (p->state != BLOCKED && blocked) {
    p->blocked_for = 0;
    berth_process_set_error(p->image, blocked_code, 0x81);
    return BLOCKED;
  }
  if (p->state == BLOCKED) {
    p->blocked_for += cycle_ms;
    if (blocked || p->blocked_for < clear_ms) return BLOCKED;
    berth_process_set_error(p->image, 0, 0);
    return IDLE;
  }
  if (!may_run) return IDLE;
  if (p->state == IDLE) {
    ++p->starts;
    return STARTING;
  }
  if (p->state == STARTING && (input_byte(p, drive, 1) & 2)) return RUNNING;
  return p->state;
}

static void count(struct program *p) {
  const long long discharged = input_word(p, belt, 1); /* kg modulo 32768 */
  long long more = (discharged - p->seen) & 0x7FFF;
  if (!p->counted || more > most_at_once) more = 0; /* this program, or the module, has begun anew */
  p->counted = 1;
  p->seen = discharged;
  p->total += more;
  p->flow = 0.99 * p->flow + 0.01 * (double)more * 1000.0 / cycle_ms;
  if (p->state == RUNNING) {
    p->run_ms += cycle_ms;
    if (p->number == 1) p->grabbed += 1; /* kg in 5 ms: the unloader's grab */
  }
  p->energy += (double)input_word(p, drive, 2) * cycle_ms / 3600000.0;
  p->beat_for += cycle_ms;
  if (p->beat_for >= 100) {
    p->beat_for = 0;
    p->beat = (p->beat + 1) & 0xFF;
  }
}

static void drive_modules(const struct program *p) {
  const int on = p->state == STARTING || p->state == RUNNING;
  const long long speed = input_word(p, drive, 1), load = input_word(p, belt, 2);
  const long long fed = p->number == 1 ? p->grabbed : get(p, "prev_total");
  output_byte(p, drive, 1, on);
  output_word(p, drive, 1, on * get(p, "set_speed"));
  output_word(p, drive, 2, load);
  output_byte(p, belt, 1, on);
  output_word(p, belt, 1, speed);
  output_word(p, belt, 2, fed & 0x7FFF);
  output_byte(p, scale, 1, on);
  output_word(p, scale, 1, speed);
  output_word(p, scale, 2, load);
  output_byte(p, panel, 1, 1 << p->state);
}

static void tell(const struct program *p) {
  const long long speed = input_word(p, drive, 1), load = input_word(p, belt, 2);
  set(p, "running", p->state == RUNNING);
  set(p, "speed", speed);
  set(p, "state", p->state);
  set(p, "beat", p->beat);
  set(p, "may_feed", p->state == RUNNING);
  set(p, "room", most(0, 5000 - load));
  set(p, "speed_left", get(p, "set_speed") - speed);
  set_real(p, "flow", p->flow);
  set(p, "total", p->total);
  set(p, "moisture", input_word(p, scale, 3));
  set(p, "batch", p->total / 500);
  set(p, "current", input_word(p, drive, 2));
  set(p, "motor_temperature", input_word(p, drive, 3));
  set(p, "bearing_temperature", input_word(p, drive, 4));
  set(p, "gear_temperature", input_word(p, panel, 2));
  set(p, "tension", input_word(p, belt, 3));
  set(p, "slip", most(-128, least(127, (input_word(p, belt, 4) - speed) / 10)));
  set(p, "load", load);
  set(p, "run_ms", p->run_ms);
  set(p, "starts", p->starts);
  set_real(p, "energy", p->energy);
  set(p, "vibration", input_word(p, scale, 2));
  set(p, "dust", input_word(p, scale, 4));
  set(p, "oil_temperature", input_word(p, panel, 1));
  set(p, "ambient_temperature", input_word(p, panel, 3));
  set(p, "voltage", input_word(p, panel, 4));
}

static void cycle(struct program *p) {
  berth_process_refresh(p->image);
  const berth_diagnosis *diagnosis = berth_process_diagnosis(p->image);
  p->number = diagnosis->node_id;
  if (diagnosis->nmt_state == 5) {
    p->state = next_state(p);
    count(p);
    drive_modules(p);
    tell(p);
  } else {
    p->state = IDLE;
  }
  berth_process_commit(p->image);
}

/* ---- the cycle ---- */

static long long now_ns(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (long long)now.tv_sec * 1000000000 + now.tv_nsec;
}

static void sleep_until(long long at_ns) {
  const struct timespec at = {(time_t)(at_ns / 1000000000), (long)(at_ns % 1000000000)};
  while (!ended && clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL) != 0) {
  }
}

/* Waits for the image: the process that has the device may begin later, or anew. */
static berth_process *opened(const char *name, long long until_ns) {
  char why[200] = "", told[200] = "";
  while (!ended && now_ns() < until_ns) {
    berth_process *image = berth_process_open(name, why, sizeof why);
    if (image) return image;
    if (strcmp(why, told) != 0) fprintf(stderr, "%s\n", why);
    strcpy(told, why);
    sleep_until(now_ns() + 100000000);
  }
  return NULL;
}

int main(int argc, char **argv) {
  if (argc != 2 && argc != 3) {
    fprintf(stderr, "usage: %s IMAGE [SECONDS]\n", argv[0]);
    return 2;
  }
  signal(SIGINT, end);
  signal(SIGTERM, end);
  const long long began = now_ns();
  const long long until = argc == 3 ? began + (long long)(atof(argv[2]) * 1e9) : began + (1LL << 61);
  struct program program;
  long long cycles = 0, late = 0, longest = 0;
  memset(&program, 0, sizeof program);
  program.image = opened(argv[1], until);
  if (program.image) printf("image \"%s\": %zu variables\n", argv[1], berth_process_count(program.image));
  fflush(stdout);
  for (long long at = now_ns(); program.image && !ended && at < until; at += cycle_ms * 1000000LL) {
    sleep_until(at);
    const long long behind = now_ns() - at;
    if (behind > longest) longest = behind;
    if (behind > cycle_ms * 1000000LL) {
      late += behind / (cycle_ms * 1000000LL);
      at = now_ns(); /* cycles that were missed are left out */
    }
    cycle(&program);
    ++cycles;
    if (cycles % 200 == 0 && !berth_process_connected(program.image)) {
      fprintf(stderr, "image \"%s\": the device's process has ended\n", argv[1]);
      berth_process_close(program.image);
      program.image = opened(argv[1], until);
      at = now_ns();
    }
  }
  berth_process_close(program.image);
  printf("%lld cycles of %d ms, %lld of them left out; the latest began %.2f ms late\n", cycles, cycle_ms, late,
         (double)longest / 1e6);
  return 0;
}
