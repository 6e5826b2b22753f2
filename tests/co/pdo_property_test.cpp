// What a running set of PDOs made of any writes is what a set that starts afterwards makes of the records.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <algorithm>
#include <cstdint>
#include <string>

#include "berth/base/random.hpp"
#include "pdo_rig.hpp"

using namespace berth;
using namespace berth::test;
using co::PdoKind;

namespace {

std::uint32_t random_entry(Random& random) {
  const std::uint32_t good[]{entry(0x2001, 0, 8),  entry(0x2002, 0, 16), entry(0x2003, 0, 32), entry(0x2004, 0, 64),
                             entry(0x2005, 0, 1),  entry(0x2006, 0, 24), entry(0x2007, 0, 16), entry(0x2008, 0, 16),
                             entry(0x2010, 3, 32), entry(0x2011, 7, 1),  entry(0x0005, 0, 8),  entry(0x2001, 0, 7)};
  return good[random.below(std::size(good))];
}

void random_write(Rig& rig, Random& random) {
  const auto number = static_cast<std::uint16_t>(random.below(4));
  const auto communication = static_cast<std::uint16_t>((random.below(2) == 0 ? 0x1400 : 0x1800) + number);
  const auto mapping = static_cast<std::uint16_t>(communication + 0x200);
  const std::uint8_t types[]{0, 1, 2, 240, 0xF1, 0xFC, 0xFD, 0xFE, 0xFF};
  const std::uint8_t counts[]{0, 1, 2, 3, 8, 9, 254, 255};
  switch (random.below(12)) {
    case 0:
    case 1: (void)rig.write_u32(communication, 1, 0x80000000U); return;
    case 2:
    case 3:
    case 4: {
      const auto base = static_cast<std::uint32_t>(communication < 0x1800 ? 0x200 : 0x180);
      const auto id = base + 0x100U * number + (random.below(8) == 0 ? 6U : 5U);
      (void)rig.write_u32(communication, 1, id | (random.below(4) == 0 ? 0x40000000U : 0U));
      return;
    }
    case 5: (void)rig.write_u8(communication, 2, types[random.below(std::size(types))]); return;
    case 6: (void)rig.write_u16(communication, 3, static_cast<unsigned>(random.below(3))); return;
    case 7: (void)rig.write_u8(mapping, 0, counts[random.below(std::size(counts))]); return;
    case 8: (void)rig.write_u8(mapping, 0, 0); return;
    default: (void)rig.write_u32(mapping, static_cast<std::uint8_t>(1 + random.below(3)), random_entry(random));
  }
}

// What a set does with an event of each TPDO, two SYNCs, a remote frame and a frame for each RPDO.
struct Behaviour {
  Log log;
  std::string flags;
};

Behaviour behaviour(Rig& rig) {
  co::Pdos& pdos = rig.pdos;
  Behaviour b;
  rig.run(2s);
  rig.take();
  for (unsigned n = 1; n <= 4; ++n) {
    b.flags += pdos.active(PdoKind::rpdo, n) ? 'R' : '-';
    b.flags += pdos.active(PdoKind::tpdo, n) ? 'T' : '-';
    b.flags += pdos.event(n) ? 'e' : '-';
    rig.run(5ms);
  }
  for (int i = 0; i < 2; ++i) {
    pdos.sync(0, rig.executor.now());
    rig.run(5ms);
  }
  for (const char* frame : {"185#R1", "285#R1", "205#0102030405060708", "305#1112131415161718"}) {
    rig.peer.send(frame);
    rig.run(5ms);
  }
  pdos.sync(0, rig.executor.now());
  for (unsigned n = 1; n <= 4; ++n) pdos.event(n);
  rig.run(50ms);
  b.log = rig.take();
  return b;
}

RC_GTEST_PROP(PdosProperty, A8_6_WritesWhileRunningAreAsGoodAsAFreshStart, (std::uint64_t seed)) {
  Random random(seed);
  Rig rig;
  rig.values.set({0x2001, 0}, 0x5A);
  rig.values.set({0x2010, 3}, 0xCAFEBABEU);
  rig.pdos.start(Rig::node);
  const auto writes = random.below(300);
  for (std::uint64_t i = 0; i < writes; ++i) {
    random_write(rig, random);
    if (random.below(20) == 0) rig.run(1ms);
  }
  const auto bytes = [&] {
    Log all;
    for (const auto& sub : rig.values.description().subs()) {
      const auto value = rig.values.stored(sub);
      all.emplace_back(value.begin(), value.end());
    }
    return all;
  };
  const auto before = bytes();
  const Behaviour running = behaviour(rig);
  const auto after = bytes();
  rig.pdos.stop();
  RC_ASSERT(rig.owner.active.empty());
  // The same values again, for a set of its own.
  Rig fresh;
  const auto subs = fresh.values.description().subs();
  for (std::size_t i = 0; i < subs.size(); ++i) {
    std::copy(before[i].begin(), before[i].end(), fresh.values.scalar(subs[i]) + (subs[i].variable_length() ? 4 : 0));
  }
  fresh.pdos.start(Rig::node);
  const Behaviour anew = behaviour(fresh);
  RC_ASSERT(running.flags == anew.flags);
  RC_ASSERT(running.log == anew.log);
  Log fresh_after;
  for (const auto& sub : subs) {
    const auto value = fresh.values.stored(sub);
    fresh_after.emplace_back(value.begin(), value.end());
  }
  RC_ASSERT(after == fresh_after);
}

// Whatever the network wrote: a valid PDO's records can be used, so that no PDO is silent without a reason.
RC_GTEST_PROP(PdosProperty, A8_7_AcceptedWritesNeverLeaveAFaultyValidPdo, (std::uint64_t seed)) {
  Random random(seed);
  Rig rig;
  for (int i = 0; i < 400; ++i) random_write(rig, random);
  for (unsigned n = 1; n <= 4; ++n) {
    for (const auto kind : {PdoKind::rpdo, PdoKind::tpdo}) {
      const auto communication = static_cast<std::uint16_t>((kind == PdoKind::rpdo ? 0x13FF : 0x17FF) + n);
      const co::CobId cob(rig.values.get<std::uint32_t>({communication, 1}).value());
      if (cob.valid()) RC_ASSERT(rig.pdos.problem(kind, n) == od::AbortCode::none);
    }
  }
}

}  // namespace
