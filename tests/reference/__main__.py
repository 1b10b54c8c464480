"""Print the reference values of a scheme; in the folder tests: python -m reference FAMILY NAME [RE [DISTURBANCE]]."""

import sys

from reference.cloud import cloud_for, reference_value


def main(family, key, re="2.1", disturbance="0.2"):
    for d in (2, 3):
        cloud = cloud_for(d, re=float(re), disturbance=float(disturbance), shore=family == "shifting")
        print(f'"{d}D" = {reference_value(family, key, cloud):.12g}')  # noqa: T201


if __name__ == "__main__":
    main(*sys.argv[1:])
