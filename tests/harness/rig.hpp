// The rig (berth/harness/rig.hpp) with the example files of this repository, and paper 1's machine.
#pragma once

#include <cstdint>
#include <string>

#include "../paths.hpp"
#include "berth/harness/rig.hpp"

namespace berth::harness {

inline std::string example_eds(const std::string& name) { return berth::test::source_dir() + "/examples/eds/" + name; }

// A pump has its description.
inline plant::PlantDevice& add_device(plant::PlantFile& p, const std::string& name, TypeCode type, std::uint32_t serial,
                                      const std::string& bus = "backbone") {
  plant::PlantDevice& d = add_plain_device(p, name, type, serial, bus);
  if (type == type_pump) d.eds = d.eds_path = example_eds("pump.eds");
  return d;
}

// Paper 1's machine (Table I) and its five slaves (Table II; s4 and s5: S1.38).
inline design::Machine five_slots() {
  design::Machine m = one_bus(50'000);
  add_slot(m, 1, type_a);
  add_slot(m, 2, type_b);
  add_slot(m, 3, type_c);
  add_slot(m, 4, type_b);
  add_slot(m, 5, type_b);
  return m;
}

inline plant::PlantFile five_slaves(std::uint64_t seed = 1) {
  plant::PlantFile p = one_bus_plant(seed);
  add_device(p, "d1", type_a, 0x0A);
  add_device(p, "d2", type_b, 5);
  add_device(p, "d3", type_c, 8);
  add_device(p, "d4", type_b, 6);
  add_device(p, "d5", type_b, 7);
  return p;
}

}  // namespace berth::harness
