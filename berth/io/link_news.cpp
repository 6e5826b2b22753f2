#include "berth/io/link_news.hpp"

namespace berth::io {

void LinkNews::ready(std::uint32_t) noexcept {
  bool news = false;
  for (int packets = 0; packets < 16; ++packets) {
    const auto heard = links_.receive();
    if (!heard) break;
    news = news || heard->overrun;
    for (const auto& notice : heard->notices) {
      if (notice.sequence == sequence_) {
        owner_->answered(notice);
      } else if (notice.link.name == name_ || notice.link.index == index_) {
        news = true;
      }
    }
  }
  if (news) ask();
}

}  // namespace berth::io
