// The main job at every size, with every kind of device, at every bit rate: the bus time from blank devices to
// operational (berth/harness/matrix.hpp says what a cell is), and how it compares with the best published method.
// The first part is ./run matrix, optimised.
#include "tests/harness/matrix_run.hpp"

using namespace berth::harness::matrix;

int main() {
  const Choice everything;
  const auto cells = cells_of(everything);
  const auto all = run_all(everything, cells);
  print_table(cells, all);
  print_sum(cells, all);
  const auto list = ratios(everything, cells, all);
  print_ratios(cells, list);
  return 0;
}
