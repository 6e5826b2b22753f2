// The plant's events after a milestone, as in `berth up`.
#pragma once

#include "berth/operate/report.hpp"
#include "berth/plant/plant_file.hpp"

namespace berth::harness {

inline plant::After after(operate::Milestone milestone) {
  switch (milestone) {
    case operate::Milestone::discovered: return plant::After::discovered;
    case operate::Milestone::bound: return plant::After::bound;
    case operate::Milestone::operational: break;
  }
  return plant::After::operational;
}

}  // namespace berth::harness
