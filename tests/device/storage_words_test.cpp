// OD.1010, OD.1011: a capability that is another than the description's is told in words.
#include <gtest/gtest.h>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/device/storage_words.hpp"

#include "../pch.hpp"
#include "rig.hpp"

namespace berth::device::test {
namespace {

std::shared_ptr<const od::Description> described(std::uint32_t save, std::uint32_t restore) {
  od::DescriptionBuilder b;
  add_device(b);
  b.object(0x1010, od::ObjectCode::array, "Store");
  b.sub(0x1010, {.sub = 1, .initial = od::Literal::number(save)});
  b.object(0x1011, od::ObjectCode::array, "Restore");
  b.sub(0x1011, {.sub = 1, .initial = od::Literal::number(restore)});
  return b.build();
}

std::vector<std::string> words_of(std::uint32_t save, std::uint32_t restore, bool memory = true) {
  Rig rig;
  const auto description = described(save, restore);
  const auto port = rig.bus.attach();
  can::Dispatcher dispatcher(rig.world.executor(), *port);
  SimFlash flash(rig.world.executor(), memory_size(*description), milliseconds(0));
  const Device device(dispatcher, description, memory ? &flash : nullptr, {.address = address_of(5)});
  return storage_words(device);
}

TEST(StorageWords, OD_1010_OD_1011_NothingToSayWhereTheyAgree) { EXPECT_TRUE(words_of(1, 1).empty()); }

TEST(StorageWords, OD_1010_WhatItDoesAndWhatTheDescriptionPromised) {
  using Words = std::vector<std::string>;
  EXPECT_EQ(words_of(3, 1), Words{"1010h:01 reports 1h, its description 3h: it stores on command and not by itself"});
  EXPECT_EQ(words_of(0, 1), Words{"1010h:01 reports 1h, its description 0h: it stores on command"});
  EXPECT_EQ(words_of(1, 1, false),
            (Words{"1010h:01 reports 0h, its description 1h: it has no memory for them, and stores nothing",
                   "1011h:01 reports 0h, its description 1h: it has no memory to restore"}));
}

}  // namespace
}  // namespace berth::device::test
