/* A run-time system in C, outside of Berth. */
#include <berth/process/process.h>
#include <stdio.h>

int main(void) {
  char why[200] = "";
  berth_process *image = berth_process_open("test-outside", why, sizeof why);
  if (image) return 1;
  puts(why);
  return 0;
}
