#include "berth/nodeid/rand_slave.hpp"

namespace berth::nodeid {

void RandSlave::power_on() noexcept {
  state_ = Identification::unknown;
  matched_ = 0;
}

std::optional<can::Frame> RandSlave::handle(const can::Frame& frame, bool in_lss_configuration) noexcept {
  if (options_.literal && !in_lss_configuration) return std::nullopt;
  const auto request = decode_rand_request(frame);
  if (!request) return std::nullopt;
  if (request->kind == RandRequest::Kind::switch_selective) {
    select(*request);
    return std::nullopt;
  }
  matched_ = 0;  // the four frames of switch selective follow each other
  if (request->kind == RandRequest::Kind::switch_global) {
    state_ = request->target;
    return std::nullopt;
  }
  if (request->kind == RandRequest::Kind::resume) return resume(*request);
  const auto phase = request->kind == RandRequest::Kind::direct ? direct_phase : request->phase;
  return identify(phase, request->mask);
}

std::optional<can::Frame> RandSlave::identify(unsigned phase, std::uint16_t mask) noexcept {
  if (state_ == Identification::identified) return std::nullopt;
  if (phase == 0) {
    state_ = Identification::selected;
    next_ = 1;
    return ius(options_.address.chunk(0));
  }
  if (state_ == Identification::unknown) return std::nullopt;
  if (phase != next_ || mask != options_.address.chunk(phase - 1)) {
    state_ = Identification::unknown;
    return std::nullopt;
  }
  if (phase == direct_phase) {
    state_ = Identification::identified;
    return dis(options_.address.chunk(7));
  }
  ++next_;
  return ius(options_.address.chunk(phase));
}

// Independent of earlier requests, so that after a lost request the slave cannot answer for another prefix.
std::optional<can::Frame> RandSlave::resume(const RandRequest& request) noexcept {
  if (!options_.resume || state_ == Identification::identified) return std::nullopt;
  if (request.phase > 0) {
    const unsigned last = request.phase - 1U;
    if (request.mask != options_.address.chunk(last)) return std::nullopt;
    if (request.value != prefix_check(options_.address, last)) return std::nullopt;
  }
  if (request.phase < direct_phase) return ius(options_.address.chunk(request.phase));
  state_ = Identification::identified;
  return dis(options_.address.chunk(7));
}

void RandSlave::select(const RandRequest& request) noexcept {
  if (request.part == 0) {
    matched_ = 0;
    target_ = request.target;
  }
  if (request.part != matched_ || request.target != target_ || request.value != options_.address.part(request.part)) {
    matched_ = 0;
    return;
  }
  if (++matched_ < 4) return;
  matched_ = 0;
  state_ = target_;
}

}  // namespace berth::nodeid
