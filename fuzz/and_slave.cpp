// Any frames at an AND slave and at the reader of its answers: it answers for its own address only, and nothing but
// the inquiry right after its DIS once it is identified.
#include <cstdint>

#include "berth/research/and_slave.hpp"
#include "fuzz/require.hpp"

namespace and_slave_target {

namespace {
using namespace berth;
using fuzz::require;
using research::AndAnswer;
using research::AndRequest;
using nodeid::Identification;

constexpr LssAddress address{1, 0x0001'0002, 3, 0x0405'0607};
}  // namespace

// Records of 10 bytes: kind of frame, its size, then 8 bytes.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  research::AndSlave slave(address);
  for (; size >= 10; data += 10, size -= 10) {
    const auto what = data[0];
    can::Frame frame =
        can::Frame::base(research::and_request_id - ((what & 0x80U) != 0 ? what & 0x3FU : 0U), {data + 2, 8});
    frame.size = (what & 1U) != 0 ? data[1] % 9 : 8;
    frame.remote = (what & 0x70U) == 0x70;
    frame.extended = (what & 0x60U) == 0x60;
    if (const auto answer = research::decode_and_answer(frame)) require(answer->nibble < 16);
    if ((what & 0x7EU) == 0x7EU) slave.power_on();
    const auto before = slave.state();
    const auto answer = slave.handle(frame);
    if (!answer) continue;
    const auto request = research::decode_and_request(frame);
    const auto read = research::decode_and_answer(*answer);
    require(request.has_value() && read.has_value() && answer->size == 8);
    if (request->kind == AndRequest::Kind::inquire) {
      require(before == Identification::identified && read->kind == AndAnswer::Kind::address);
      continue;
    }
    require(before == Identification::unknown);
    const unsigned phase = request->phase;
    require(slave.address().prefix(phase) == request->address);
    require(read->nibble == slave.address().nibble(phase == research::and_direct_phase ? 11 : phase));
    require((read->kind == AndAnswer::Kind::dis) == (slave.state() == Identification::identified));
  }
  return 0;
}

}  // namespace and_slave_target
