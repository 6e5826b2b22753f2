// What stands in 1F20h and 1F23h: the text as it is, or compressed.
#include "berth/manager/stored_dcf.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <string>
#include <vector>

using namespace berth;
using namespace berth::manager;

RC_GTEST_PROP(StoredDcf, EveryTextComesBack, (const std::string& text)) {
  const auto back = unpack_stored(stored_format::zlib, pack_stored(text));
  RC_ASSERT(back.has_value());
  RC_ASSERT(*back == text);
  const std::vector<std::uint8_t> bytes(text.begin(), text.end());
  RC_ASSERT(*unpack_stored(stored_format::ascii, bytes) == text);
}

// Every stream that is cut, and every one with a bit flipped behind its head, is no text: RFC 1950 ends with a
// checksum.
TEST(StoredDcf, ADamagedStreamIsNoText) {
  const std::string text = "[FileInfo]\nFileName=slave.dcf\nFileVersion=1\n[DeviceInfo]\nVendorName=Maker\n";
  const auto packed = pack_stored(text);
  for (std::size_t length = 0; length < packed.size(); ++length) {
    const auto cut = unpack_stored(stored_format::zlib, std::span(packed).first(length));
    ASSERT_FALSE(cut) << length;
    EXPECT_EQ(cut.error().code, Errc::invalid);
  }
  for (std::size_t byte = 0; byte < packed.size(); ++byte) {
    for (unsigned bit = 0; bit < 8; ++bit) {
      auto damaged = packed;
      damaged[byte] = static_cast<std::uint8_t>(damaged[byte] ^ 1U << bit);
      const auto read = unpack_stored(stored_format::zlib, damaged);
      EXPECT_TRUE(!read || *read == text) << byte << '.' << bit;
    }
  }
  auto longer = packed;
  longer.push_back(0);
  EXPECT_FALSE(unpack_stored(stored_format::zlib, longer)) << "a byte behind it";
}

TEST(StoredDcf, OtherFormatsAreNotKnown) {
  for (unsigned format = 1; format < 256; ++format) {
    if (format == stored_format::zlib) continue;
    const auto read = unpack_stored(static_cast<std::uint8_t>(format), {});
    ASSERT_FALSE(read);
    EXPECT_EQ(read.error().code, Errc::unsupported);
  }
}

// A few thousand bytes can stand for gigabytes.
TEST(StoredDcf, AStreamThatUnpacksToTooMuchIsRefused) {
  const std::string most(longest_stored_text, 'x');
  EXPECT_TRUE(unpack_stored(stored_format::zlib, pack_stored(most)));
  const auto bomb = pack_stored(most + "x");
  EXPECT_LT(bomb.size(), 10'000U);
  const auto read = unpack_stored(stored_format::zlib, bomb);
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().code, Errc::invalid);
}
