// SdoAccess from a coroutine, and the value that uploads give.
#include <gtest/gtest.h>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/co/sdo_access.hpp"

#include "berth/co/sdo_server.hpp"
#include "berth/rt/scope.hpp"
#include "dictionary.hpp"
#include "wire.hpp"

using namespace berth;
using namespace berth::test;

namespace {

using Bytes = std::vector<std::uint8_t>;

rt::Task<void> use_access(co::SdoAccess& access, std::uint32_t& type, std::string& text, Result<void>& refused) {
  auto number = co_await access.read_u32(0x1000, 0);
  if (number) type = *number;
  const std::string hello = "hello, dictionary";
  const std::span<const std::uint8_t> bytes(reinterpret_cast<const std::uint8_t*>(hello.data()), hello.size());
  auto written = co_await access.write(0x2003, 0, bytes);
  if (!written) co_return;
  auto back = co_await access.read(0x2003, 0);
  if (back) text = back->text();
  refused = co_await access.write_u32(0x1000, 0, 1);
}

TEST(SdoAccess, ReadsAndWritesANodeFromACoroutine) {
  Bench b;
  Station device(b.wire), station(b.wire);
  od::Values values(test_description(), NodeId(5));
  co::SdoServerService server(device.dispatcher, values);
  server.start(NodeId(5));
  co::SdoClient client(station.dispatcher);
  co::NodeAccess access(client, NodeId(5));
  std::uint32_t type = 0;
  std::string text;
  Result<void> refused;
  rt::Scope scope(b.executor);
  scope.spawn(use_access(access, type, text, refused));
  b.run(1s);
  EXPECT_EQ(scope.running(), 0U);
  EXPECT_EQ(type, 0x00020192U);
  EXPECT_EQ(text, "hello, dictionary");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().detail, 0x06010002U);
}

TEST(SdoValue, SmallAndLarge) {
  co::SdoValue value;
  EXPECT_TRUE(value.empty());
  Bytes all;
  for (std::uint8_t i = 0; i < 40; ++i) {
    const Bytes piece(i % 9, i);
    value.append(piece);
    all.insert(all.end(), piece.begin(), piece.end());
    ASSERT_EQ(Bytes(value.bytes().begin(), value.bytes().end()), all);
  }
  const co::SdoValue copy = value;
  const co::SdoValue moved = std::move(value);
  EXPECT_EQ(copy, moved);
  EXPECT_TRUE(value.empty());
  EXPECT_EQ(value.bytes().size(), 0U);
  EXPECT_EQ(co::SdoValue(Bytes{0xFE, 0xFF}).as<std::int16_t>(), -2);
  EXPECT_FALSE(co::SdoValue(Bytes{1}).as<std::uint16_t>());
  EXPECT_EQ(co::SdoValue(Bytes{'a', 0, 'b'}).text(), "a");
}

}  // namespace
