// Runs ESPHome's own PIDController on readings from stdin, a case after another: six floats and the count, then its rows of three
// floats (setpoint, reading, ms since the reading before). Writes the output of each as a float.
#include <cmath>
#include <cstdint>
#include <cstdio>

#include "esphome/components/pid/pid_controller.h"

namespace esphome {
static uint32_t now_ms = 1;
uint32_t millis() { return now_ms; }
namespace pid {
class PIDClimate {
 public:
  static void set(PIDController &c, const float *words) {
    c.kp_ = words[0];
    c.ki_ = words[1];
    c.kd_ = words[2];
    c.min_integral_ = words[3];
    c.max_integral_ = words[4];
    c.derivative_samples_ = static_cast<int>(words[5]);
    c.derivative_window_.init(8);
    c.output_window_.init(8);
  }
};
}  // namespace pid
}  // namespace esphome

int main() {
  float words[7];
  while (std::fread(words, sizeof(float), 7, stdin) == 7) {
    esphome::now_ms = 1000;
    esphome::pid::PIDController controller;
    esphome::pid::PIDClimate::set(controller, words);
    for (int left = static_cast<int>(words[6]); left > 0; left--) {
      float row[3];
      if (std::fread(row, sizeof(float), 3, stdin) != 3) return 1;
      esphome::now_ms += static_cast<uint32_t>(row[2]);
      const float output = controller.update(row[0], row[1]);
      std::fwrite(&output, sizeof(float), 1, stdout);
    }
  }
  return 0;
}
