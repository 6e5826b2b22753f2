// S2.5 to S2.10, S2.27: the identifiers of paper 2's negotiation.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <cstdint>
#include <string>

#include <bit>
#include <cmath>

#include "berth/nodeid/rand_frames.hpp"
#include "berth/research/negotiation_frames.hpp"

namespace berth::research {
namespace {

using namespace nodeid;

using Kind = NegotiationMessage::Kind;
constexpr LssAddress figure2{0x00000319, 0xAA55EEFF, 0xDEADBEEF, 0x12345678};

// S2.8, S2.16: the sixteen identifiers of Figure 2 and what its window says to them, typed from the paper.
TEST(NegotiationFrames, IdentityOfFigure2) {
  const std::pair<std::uint32_t, const char*> lines[] = {
      {0x1019, "sub: 1, byte: 0, value: 0x19"}, {0x1103, "sub: 1, byte: 1, value: 0x03"},
      {0x1200, "sub: 1, byte: 2, value: 0x00"}, {0x1300, "sub: 1, byte: 3, value: 0x00"},
      {0x14ff, "sub: 2, byte: 0, value: 0xff"}, {0x15ee, "sub: 2, byte: 1, value: 0xee"},
      {0x1655, "sub: 2, byte: 2, value: 0x55"}, {0x17aa, "sub: 2, byte: 3, value: 0xaa"},
      {0x18ef, "sub: 3, byte: 0, value: 0xef"}, {0x19be, "sub: 3, byte: 1, value: 0xbe"},
      {0x1aad, "sub: 3, byte: 2, value: 0xad"}, {0x1bde, "sub: 3, byte: 3, value: 0xde"},
      {0x1c78, "sub: 4, byte: 0, value: 0x78"}, {0x1d56, "sub: 4, byte: 1, value: 0x56"},
      {0x1e34, "sub: 4, byte: 2, value: 0x34"}, {0x1f12, "sub: 4, byte: 3, value: 0x12"}};
  for (unsigned i = 0; i < 16; ++i) {
    const auto frame = identity(figure2, i);
    EXPECT_EQ(frame.id, lines[i].first);
    EXPECT_TRUE(frame.extended);
    EXPECT_EQ(frame.size, 0) << "S2.4: nothing in the data field";
    const auto message = decode_negotiation(frame);
    ASSERT_TRUE(message);
    std::string words = interpretation(*message);
    std::erase(words, '0');  // the figure's window drops zeros now and then ("0x3", "0x03 00")
    std::string paper = lines[i].second;
    std::erase(paper, '0');
    EXPECT_EQ(words, paper);
  }
  EXPECT_EQ(interpretation(*decode_negotiation(identity(figure2, 0))), "sub: 1, byte: 0, value: 0x19");
  EXPECT_EQ(interpretation(*decode_negotiation(request_used())), "Request used node-IDs");
}

// S2.9: the paper's fragment, as printed but for the type names.
std::uint32_t fragment(const std::uint32_t identity_object[4], std::uint32_t byteNr) {
  std::uint32_t idx = byteNr / 4;
  std::uint32_t canId = identity_object[idx];
  idx <<= 2;
  idx += (byteNr % 4);
  idx <<= 8u;
  canId >>= ((byteNr % 4) * 8u);
  canId &= 0xff;
  canId |= idx;
  canId |= 0x1000ul;
  return canId;
}

// S2.9
RC_GTEST_PROP(NegotiationFrames, TheFragmentGivesTheSameIdentifiers, ()) {
  const auto part = rc::gen::arbitrary<std::uint32_t>();
  const LssAddress a{*part, *part, *part, *part};
  const std::uint32_t object[4] = {a.vendor, a.product, a.revision, a.serial};
  for (unsigned i = 0; i < 16; ++i) RC_ASSERT(identity(a, i).id == fragment(object, i));
}

// S2.10: 100h, 200h | node-ID; all else is reserved and not ours.
TEST(NegotiationFrames, FlowControlAndReservedCodes) {
  EXPECT_EQ(request_used().id, 0x100U);
  EXPECT_EQ(used(NodeId(0x20)).id, 0x220U);
  EXPECT_EQ(used(NodeId(127)).id, 0x27FU);
  for (std::uint32_t id = 0; id <= 0x1FFF; ++id) {
    const auto message = decode_negotiation(can::Frame::ext(id, {}));
    const bool request = id == 0x100;
    const bool act = id >= 0x201 && id <= 0x27F;
    const bool byte = id >= 0x1000;
    ASSERT_EQ(message.has_value(), request || act || byte) << std::hex << id;
    if (!message) continue;
    EXPECT_EQ(message->kind, request ? Kind::request_used : act ? Kind::used : Kind::identity);
    EXPECT_EQ(act ? message->node.value() : 0U, act ? id - 0x200 : 0U);
    EXPECT_EQ(byte ? 0x1000U | message->byte << 8U | message->value : id, id);
  }
}

// S2.5, S2.6: base, FD and remote frames of the same number, frames with data, and a reserved bit set.
RC_GTEST_PROP(NegotiationFrames, OthersAreNotOurs, ()) {
  const auto number = *rc::gen::inRange<std::uint32_t>(0, 0x2000);
  auto frame = can::Frame::ext(number, {});
  auto base = frame;
  base.extended = false;
  base.id &= can::base_mask;
  RC_ASSERT(!decode_negotiation(base));
  auto fd = frame;
  fd.fd = true;
  RC_ASSERT(!decode_negotiation(fd));
  auto remote = frame;
  remote.remote = true;
  RC_ASSERT(!decode_negotiation(remote));
  auto data = frame;
  data.size = static_cast<std::uint8_t>(*rc::gen::inRange(1, 9));
  RC_ASSERT(!decode_negotiation(data));
  auto reserved = frame;
  reserved.id |= 1U << *rc::gen::inRange(13, 29);
  RC_ASSERT(!decode_negotiation(reserved));
}

// S2.7: 13 of 29 bits, 0.0015 % of the identifiers.
TEST(NegotiationFrames, ShareOfTheIdentifiers) {
  std::uint32_t used_bits = 0;
  for (std::uint32_t value = 0; value < 256; ++value) {
    const std::uint32_t part = value * 0x01010101U;
    const LssAddress every{part, part, part, part};
    for (unsigned byte = 0; byte < 16; ++byte) used_bits |= identity(every, byte).id;
  }
  for (unsigned id = 1; id <= 127; ++id) used_bits |= used(NodeId(static_cast<std::uint8_t>(id))).id;
  EXPECT_EQ(used_bits | request_used().id, (1U << 13U) - 1) << "13 of 29";
  // Of all 2^29 identifiers no other is ever heard: none that has one of the 16 reserved bits, alone or with others.
  unsigned reserved = 0;
  for (unsigned bit = 0; bit < 29; ++bit) {
    bool heard = false;
    for (std::uint32_t low = 0; low < 0x2000; ++low) {
      const auto id = low | 1U << bit;
      heard = heard || (id != low && decode_negotiation(can::Frame::ext(id, {})));
      if (bit >= 13 && heard) ADD_FAILURE() << std::hex << id;
    }
    reserved += heard ? 0U : 1U;
    EXPECT_EQ(negotiation_frames.contains(can::extended_flag | 1U << bit), bit >= 8 && bit <= 12) << bit;
  }
  EXPECT_EQ(reserved, 16U);
  const double share = std::ldexp(1.0, static_cast<int>(std::popcount(used_bits)) - 29);
  EXPECT_EQ(std::round(share * 1e6), 15) << "0.0015 %";
}

// SX.1: RAND's and the feedback's identifiers (1F50xxxx, 1F90xxxx .. 1F94xxxx) have reserved bits set.
TEST(NegotiationFrames, ToldApartFromTheOtherSchemes) {
  EXPECT_FALSE(decode_negotiation(iurs(0, 0)));
  EXPECT_FALSE(decode_negotiation(ius(0x0100)));
  EXPECT_FALSE(decode_negotiation(dis(0x1019)));
  EXPECT_FALSE(rand_requests.contains(can::extended_flag | 0x1FFF));
  EXPECT_FALSE(negotiation_frames.contains(can::extended_flag | ius_id));
}

}  // namespace
}  // namespace berth::research
