// What a port has noted for its listener, and delivers between two looks at its descriptors.
#include "berth/io/deliveries.hpp"

#include <gtest/gtest.h>

#include <array>
#include <vector>

#include "berth/rt/executor.hpp"

namespace berth::io {
namespace {

struct Receiver final : can::Listener {
  void received(const can::Frame& frame, rt::Time) noexcept override { ids.push_back(frame.id); }
  void sent(std::uint32_t, rt::Time) noexcept override {}
  void changed(const can::Status&, rt::Time) noexcept override {}
  std::vector<std::uint32_t> ids;
};

constexpr std::array all_identifiers{can::IdRange{0, 0xFFFF'FFFF}};

}  // namespace

TEST(Deliveries, WhatWasHeardForOneListenerIsNotDeliveredToTheNext) {
  rt::Executor executor;
  Deliveries deliveries(executor);
  Receiver first, second;
  deliveries.listen(&first, all_identifiers);
  deliveries.received(can::Frame::base(0x701, {0x05}), rt::Time{});
  deliveries.listen(&second, all_identifiers);
  deliveries.received(can::Frame::base(0x702, {0x05}), rt::Time{});
  executor.advance(executor.now());
  EXPECT_TRUE(first.ids.empty());
  EXPECT_EQ(second.ids, std::vector<std::uint32_t>{0x702});
}

// The same listener with other ranges: what is noted stays, as far as they hold it.
TEST(Deliveries, OtherRangesCountForWhatIsNoted) {
  rt::Executor executor;
  Deliveries deliveries(executor);
  Receiver ear;
  deliveries.listen(&ear, all_identifiers);
  deliveries.received(can::Frame::base(0x701, {0x05}), rt::Time{});
  deliveries.received(can::Frame::base(0x081, {0x05}), rt::Time{});
  deliveries.listen(&ear, std::array{can::IdRange{0x700, 0x77F}});
  executor.advance(executor.now());
  EXPECT_EQ(ear.ids, std::vector<std::uint32_t>{0x701});
}

}  // namespace berth::io
