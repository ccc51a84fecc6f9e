// A program that would hand over a type of another layout than the library's.
#include <sigmaik/servo.hpp>

int main() { return sizeof(sigmaik::ServoOptions) == 0; }
