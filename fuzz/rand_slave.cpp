// Any frames at a RAND slave: it answers with its own chunks only, and nothing once it is identified.
#include <cstdint>
#include <cstdlib>

#include "berth/nodeid/rand_slave.hpp"

namespace rand_slave_target {

namespace {
using namespace berth;
using nodeid::Identification;

void must(bool holds) {
  if (!holds) std::abort();
}
constexpr LssAddress address{1, 1, 0, 5};
}  // namespace

// Records of 10 bytes: kind of frame, its size, then 8 bytes.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  nodeid::RandSlave slave({.address = address, .literal = size % 2 == 1, .resume = size % 4 >= 2});
  for (; size >= 10; data += 10, size -= 10) {
    const auto what = data[0];
    can::Frame frame = can::Frame::ext(nodeid::rand_request_id | ((what & 0x80U) != 0 ? what : 0U), {data + 2, 8});
    frame.size = (what & 1U) != 0 ? data[1] % 9 : 4;
    frame.remote = (what & 0x70U) == 0x70;
    if ((what & 0x7EU) == 0x7EU) slave.power_on();
    const auto before = slave.state();
    const auto next = slave.next_phase();
    const auto answer = slave.handle(frame, (what & 2U) != 0);
    must((slave.next_phase() != 0) == (slave.state() == Identification::selected));
    if (!answer) continue;
    must(before != Identification::identified);
    const auto read = nodeid::decode_rand_answer(*answer);
    must(read.has_value() && answer->size == 0);
    const unsigned phase = frame.data[1];
    must(read->direct == (phase == nodeid::direct_phase));
    must(read->chunk == address.chunk(read->direct ? 7 : phase));
    if (frame.data[0] == 0x86) {  // the extension: at any depth, for its own prefix
      must(frame == nodeid::resume_request(phase, address));
      must(read->direct || slave.state() == before);
    } else {
      must(phase == 0 || phase == next);
    }
  }
  return 0;
}

}  // namespace rand_slave_target
